"""Control step of a brain, from observations to torques.

Letters: `n` links, `K` neurons.
"""

import jax
import jax.numpy as jnp

from mjxgait.controllers.sims_brain.neurons import fired
from mjxgait.controllers.sims_brain.wiring import Brain
from mjxgait.types import pytree

TICKS = 2
"""Brain steps per command (Sims 1994, section 3.2)."""


@pytree
class Mind:
    """Memory of a brain: the neurons' values and memories, [K] each."""

    values: jax.Array
    memory: jax.Array


@pytree
class Perceived:
    """Observations. angles: [n] rad. contact: [n] 0 or 1. light: [n, 3] direction in block axes."""

    angles: jax.Array
    contact: jax.Array
    light: jax.Array


def blank(neurons: int) -> Mind:
    """Return the memory before the first step."""
    none = jnp.zeros(neurons)
    return Mind(none, none)


def thought(brain: Brain, mind: Mind, perceived: Perceived, step: float) -> tuple[jax.Array, Mind]:
    """Return the torques [n] in N·m of the hinges, and the next memory. step: s per command.

    All neurons fire at once, on the values of the previous tick.
    """
    mirrored = jnp.stack([jnp.ones_like(brain.image), brain.image], axis=1)[:, jnp.array([0, 1, 0])]
    known = jnp.concatenate(
        [
            jnp.array([0.0, 1.0]),
            perceived.angles * brain.sign,
            perceived.contact,
            (perceived.light * mirrored).reshape(-1),
        ]
    )
    values, memory = mind.values, mind.memory
    for _ in range(TICKS):
        inputs = jnp.concatenate([known, values])[brain.source] * brain.weight
        values, memory = fired(brain.kind, inputs, memory, step / TICKS)
    wanted = jnp.concatenate([known, values])[brain.drive]
    return brain.pull * jnp.clip(brain.gain * wanted, -1.0, 1.0), Mind(values, memory)
