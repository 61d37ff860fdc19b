"""The nervous system's genotype: neurons that each node brings along, and some that belong to no part.

Letters: `N` nodes, `Q` neurons of a node, `M` central ones; 3 inputs each, 3 effectors per node.
"""

import dataclasses
from collections.abc import Mapping

import jax
import jax.numpy as jnp

from mjxgait.controllers.sims_brain.chance import normal, numbered, numbers
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.reference_body.material import INPUTS, NEURONS, SENSORS
from mjxgait.types import pytree

CONSTANT, WAVE = 0.3, 0.3
"""Shares of the inputs that are drawn constant, and of the neurons that are drawn as waves. Where all
are alike, one effector in four hundred is driven by a wave of constant frequency."""


@dataclasses.dataclass(frozen=True)
class NerveRoom:
    """How many neurons a node has, and how many are central."""

    local: int = BrainConfig.local
    central: int = BrainConfig.central

    @property
    def codes(self) -> int:
        """How many kinds of source there are; see `Nerves`."""
        return 1 + SENSORS + 3 * self.local + self.central


@pytree
class Nerves:
    """What each node brings along.

    kind: [N, Q] places in `NEURONS`; source: [N, Q, 3] and weight: [N, Q, 3] of their inputs.
    effect_source, effect_weight: [N, 3] what drives each hinge to the parent.

    A source is a number: 0 the constant 1; then the part's own sensors, its own neurons, its
    parent's, its first child's, and the central ones.
    """

    kind: jax.Array
    source: jax.Array
    weight: jax.Array
    effect_source: jax.Array
    effect_weight: jax.Array


@pytree
class Centre:
    """The central neurons, [M], as in `Nerves`. They have the root part's sources."""

    kind: jax.Array
    source: jax.Array
    weight: jax.Array


def random_nerves(key: jax.Array, nodes: int, room: NerveRoom) -> Nerves:
    """Drawn at random: any function, any source; weights are normal."""
    effects = {"effect_source": (nodes, 3), "effect_weight": (nodes, 3)}
    drawn = numbers(key, _shapes((nodes, room.local)) | effects)
    source = numbered(drawn["effect_source"], room.codes)
    return Nerves(
        **_neurons(drawn, room), effect_source=source, effect_weight=normal(drawn["effect_weight"])
    )


def random_centre(key: jax.Array, room: NerveRoom) -> Centre:
    """Drawn at random, as `random_nerves`."""
    return Centre(**_neurons(numbers(key, _shapes((room.central,))), room))


def _favoured(uniform: jax.Array, share: float, one: int, count: int) -> jax.Array:
    """From [0, 1) to whole numbers: in this share of the cases one of them, else any."""
    return jnp.where(uniform < share, one, numbered((uniform - share) / (1 - share), count))


def _shapes(neurons: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
    return {"kind": neurons, "source": (*neurons, INPUTS), "weight": (*neurons, INPUTS)}


def _neurons(drawn: Mapping[str, jax.Array], room: NerveRoom) -> dict[str, jax.Array]:
    return {
        "kind": _favoured(drawn["kind"], WAVE, NEURONS.index("oscillate-wave"), len(NEURONS)),
        "source": _favoured(drawn["source"], CONSTANT, 0, room.codes),
        "weight": normal(drawn["weight"]),
    }
