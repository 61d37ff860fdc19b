"""What it costs to have parts in each other, the same for every task on a floor."""

import jax
import jax.numpy as jnp

from mjxgait.creature.body import Body

TOUCHING = 0.005
"""Hip heights; parts that are less deep in each other than this only touch."""
DEEP = 0.05
"""Hip heights beyond `TOUCHING` at which an overlap counts half: it must not cost more than a walk
brings."""


def crossed(creature: Body, overlap: jax.Array) -> jax.Array:
    """From 0 to 1, how much parts are in each other. overlap: [] m, the deepest."""
    deeper = jnp.maximum(overlap / creature.frame.hip_height - TOUCHING, 0.0)
    return deeper / (deeper + DEEP)
