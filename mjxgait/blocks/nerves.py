"""The nervous system's genotype: neurons that each node brings along, and some that belong to no part.

Letters: `N` nodes, `Q` neurons of a node, `M` central ones; 3 inputs each, 3 effectors per node.
"""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.types import pytree

NEURONS = (
    *("sum", "product", "divide", "sum-threshold", "greater-than", "sign-of", "min", "max", "abs"),
    *("if", "interpolate", "sin", "cos", "atan", "log", "expt", "sigmoid", "integrate"),
    *("differentiate", "smooth", "memory", "oscillate-wave", "oscillate-saw"),
)
"""Sims' functions, by number."""
INPUTS = 3
SENSORS = 7
"""Of a part: the angles of up to three hinges, whether it touches the ground, and the light's
direction along its own three axes."""


@dataclasses.dataclass(frozen=True)
class NerveRoom:
    """How many neurons a node has, and how many are central."""

    local: int = 3
    central: int = 4

    @property
    def codes(self) -> int:
        """How many kinds of source there are; see `Nerves`."""
        return 1 + SENSORS + 3 * self.local + self.central


@pytree
class Nerves:
    """The genotype beside a `Graph`.

    kind: [N, Q] places in `NEURONS`; source: [N, Q, 3] and weight: [N, Q, 3] of their inputs.
    effect_source, effect_weight: [N, 3] what drives each hinge to the parent. central_…: [M, …].

    A source is a number: 0 the constant 1; then the part's own sensors, its own neurons, its
    parent's, its first child's, and the central ones. Central neurons sense and neighbour what the
    root part does.
    """

    kind: jax.Array
    source: jax.Array
    weight: jax.Array
    effect_source: jax.Array
    effect_weight: jax.Array
    central_kind: jax.Array
    central_source: jax.Array
    central_weight: jax.Array


def random_nerves(key: jax.Array, nodes: int, room: NerveRoom) -> Nerves:
    """Drawn at random: any function, any source; weights are normal."""
    keys = iter(jax.random.split(key, 8))

    def numbered(count: int, *shape: int) -> jax.Array:
        return jax.random.randint(next(keys), shape, 0, count)

    def normal(*shape: int) -> jax.Array:
        return jax.random.normal(next(keys), shape)

    return Nerves(
        kind=numbered(len(NEURONS), nodes, room.local),
        source=numbered(room.codes, nodes, room.local, INPUTS),
        weight=normal(nodes, room.local, INPUTS),
        effect_source=numbered(room.codes, nodes, 3),
        effect_weight=normal(nodes, 3),
        central_kind=numbered(len(NEURONS), room.central),
        central_source=numbered(room.codes, room.central, INPUTS),
        central_weight=normal(room.central, INPUTS),
    )


def no_nerves(nodes: int, room: NerveRoom) -> Nerves:
    """Sums of nothing."""
    shapes = jax.eval_shape(lambda: random_nerves(jax.random.key(0), nodes, room))
    return jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
