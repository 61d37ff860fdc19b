"""The nervous system's genotype: neurons that each node brings along, and some that belong to no part.

Letters: `N` nodes, `Q` neurons of a node, `M` central ones; 3 inputs each, 3 effectors per node.
"""

import dataclasses

import jax

from mjxgait.champion.blocks.material import INPUTS, NEURONS, SENSORS
from mjxgait.settings.brains import BrainConfig
from mjxgait.types import pytree


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
    own, source, weight = jax.random.split(key, 3)
    kinds, sources, weights = _random_neurons(own, (nodes, room.local), room)
    effects = jax.random.randint(source, (nodes, 3), 0, room.codes)
    return Nerves(kinds, sources, weights, effects, jax.random.normal(weight, (nodes, 3)))


def random_centre(key: jax.Array, room: NerveRoom) -> Centre:
    """Drawn at random, as `random_nerves`."""
    return Centre(*_random_neurons(key, (room.central,), room))


def _random_neurons(
    key: jax.Array, shape: tuple[int, ...], room: NerveRoom
) -> tuple[jax.Array, jax.Array, jax.Array]:
    kind, source, weight = jax.random.split(key, 3)
    return (
        jax.random.randint(kind, shape, 0, len(NEURONS)),
        jax.random.randint(source, (*shape, INPUTS), 0, room.codes),
        jax.random.normal(weight, (*shape, INPUTS)),
    )
