"""Genotype of the nervous system: neurons of each node, and central neurons of no part.

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
"""Shares of inputs drawn as constants, and of neurons drawn as waves. With uniform draws a wave of
constant frequency drives only one effector in 400."""


@dataclasses.dataclass(frozen=True)
class NerveRoom:
    """Numbers of neurons per node, and of central neurons."""

    local: int = BrainConfig.local
    central: int = BrainConfig.central

    @property
    def codes(self) -> int:
        """Number of source codes; see `Nerves`."""
        return 1 + SENSORS + 3 * self.local + self.central


@pytree
class Nerves:
    """Neurons and effectors of each node.

    kind: [N, Q] indices into `NEURONS`. source, weight: [N, Q, 3] of their inputs.
    effect_source, effect_weight: [N, 3] drive of each hinge to the parent.

    A source is a number: 0 for the constant 1; then the part's own sensors, its own neurons, its
    parent's, its first child's, and the central ones.
    """

    kind: jax.Array
    source: jax.Array
    weight: jax.Array
    effect_source: jax.Array
    effect_weight: jax.Array


@pytree
class Centre:
    """Central neurons, [M], as in `Nerves`. They have the root part's sources."""

    kind: jax.Array
    source: jax.Array
    weight: jax.Array


def random_nerves(key: jax.Array, nodes: int, room: NerveRoom) -> Nerves:
    """Draw random neurons: any function, any source; weights are normal."""
    effects = {"effect_source": (nodes, 3), "effect_weight": (nodes, 3)}
    drawn = numbers(key, _shapes((nodes, room.local)) | effects)
    source = numbered(drawn["effect_source"], room.codes)
    return Nerves(
        **_neurons(drawn, room), effect_source=source, effect_weight=normal(drawn["effect_weight"])
    )


def random_centre(key: jax.Array, room: NerveRoom) -> Centre:
    """Draw random central neurons, as `random_nerves` does."""
    return Centre(**_neurons(numbers(key, _shapes((room.central,))), room))


def _favoured(uniform: jax.Array, share: float, one: int, count: int) -> jax.Array:
    """Map [0, 1) to integers: `one` in this share of the cases, else any below `count`."""
    return jnp.where(uniform < share, one, numbered((uniform - share) / (1 - share), count))


def _shapes(neurons: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
    return {"kind": neurons, "source": (*neurons, INPUTS), "weight": (*neurons, INPUTS)}


def _neurons(drawn: Mapping[str, jax.Array], room: NerveRoom) -> dict[str, jax.Array]:
    return {
        "kind": _favoured(drawn["kind"], WAVE, NEURONS.index("oscillate-wave"), len(NEURONS)),
        "source": _favoured(drawn["source"], CONSTANT, 0, room.codes),
        "weight": normal(drawn["weight"]),
    }
