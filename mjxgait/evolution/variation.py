"""Creation and variation of genomes: arrays in, arrays out.

The functions take one genome; callers map them over the offspring. This module holds what any kind
of genome may use; operators of one kind are beside its controller.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.traced import chosen
from mjxgait.evolution.chance import key_of
from mjxgait.types import Tree, pytree

Genome = TypeVar("Genome")


@pytree
class Box:
    """Lowest and highest value of each gene; leaves shaped as in one genome."""

    low: Any
    high: Any


def _unchanged(genomes: Tree) -> Tree:
    return genomes


@dataclasses.dataclass(frozen=True)
class Variation(Generic[Genome]):
    """Operators that evolution calls; a genome is only a pytree to them.

    create: key, count -> genomes [count, ...]. cross: key, genome, genome -> genome. mutate: key,
    genome -> genome. price: genomes [N, ...] -> [N], subtracted from the fitness; None: free.
    long: whether they loop along a genome place by place, which justifies some compile time.
    first: genomes [G, ...] that take the first places of the first generation; None: all are drawn.
    box: bounds of genomes of bounded reals; None: the genomes are of another kind.
    project: genomes [..., ...] -> those with the relations among genes that every new genome has.
    `create` and `mutate` apply it themselves, a drawn distribution does not.
    met: genomes [M, ...], the best genome of the last generation, whether [] opponents change now
    -> the same genomes, to meet that one as their opponent, or else its own opponent; None where
    genomes have no opponent.
    """

    create: Callable[[jax.Array, int], Genome]
    cross: Callable[[jax.Array, Genome, Genome], Genome]
    mutate: Callable[[jax.Array, Genome], Genome]
    price: Callable[[Genome], jax.Array] | None = None
    long: bool = False
    first: Genome | None = None
    box: Box | None = None
    project: Callable[[Genome], Genome] = _unchanged
    met: Callable[[Genome, Genome, jax.Array], Genome] | None = None

    def begin(self, key: jax.Array, count: int) -> Genome:
        """Return genomes [count, ...] of the first generation: `first`, the rest created."""
        created = self.create(key, count)
        if self.first is None:
            return created
        return jax.tree.map(lambda own, leaf: leaf.at[: len(own)].set(own), self.first, created)


def projected(usual: Variation, project: Callable[[Any], Any]) -> Variation:
    """Return the operators with `project` applied to every genome that they create or mutate."""
    return dataclasses.replace(
        usual,
        create=lambda key, count: project(usual.create(key, count)),
        mutate=lambda key, genome: project(usual.mutate(key, genome)),
        project=lambda genomes: project(usual.project(genomes)),
    )


def creation(box: Box, config: EvolutionConfig) -> Callable[[jax.Array, int], Any]:
    """Return a function that draws first genomes from a box, uniformly or as a Latin hypercube."""

    def create(key: jax.Array, count: int) -> Any:
        return jax.tree.map(
            partial(jnp.where, chosen(config.initial, "uniform")),
            uniform(key, box, count),
            latin_hypercube(key, box, count),
        )

    return create


def real_variation(box: Box, config: EvolutionConfig) -> Variation:
    """Return operators for genomes of reals in a box: uniform crossover, Gaussian jumps."""

    def cross(key: jax.Array, mother: Tree, father: Tree) -> Tree:
        return _leafwise(key, uniform_crossover, mother, father)

    def mutate(key: jax.Array, genome: Tree) -> Tree:
        def moved(key: jax.Array, values: jax.Array, low: jax.Array, high: jax.Array) -> jax.Array:
            return jittered(key, values, low, high, config.tuning_rate, config.sigma)

        return _leafwise(key, moved, genome, box.low, box.high)

    middle = narrowed(box, config.initial_spread)
    return Variation(create=creation(middle, config), cross=cross, mutate=mutate, box=box)


def uniform_crossover(key: jax.Array, mother: jax.Array, father: jax.Array) -> jax.Array:
    """Return an array of which each value is one parent's, with equal chances."""
    return jnp.where(jax.random.bernoulli(key, 0.5, mother.shape), mother, father)


def _leafwise(key: jax.Array, function: Callable[..., jax.Array], *trees: Tree) -> Tree:
    """Apply the function to a separate key and one array of each tree, leaf by leaf."""
    leaves, structure = jax.tree.flatten(trees[0])
    columns = zip(jax.random.split(key, len(leaves)), *map(jax.tree.leaves, trees), strict=True)
    return jax.tree.unflatten(structure, [function(*column) for column in columns])


def narrowed(box: Box, share: jax.Array | float) -> Box:
    """Return the middle of a box, `share` of its width in every gene."""

    def edge(near: Tree, far: Tree) -> Tree:
        return jax.tree.map(lambda a, b: a + 0.5 * (1 - share) * (b - a), near, far)

    return Box(edge(box.low, box.high), edge(box.high, box.low))


def in_ranges(genomes: object, box: Box) -> np.ndarray:
    """Return genomes [N, ...] as rows [N, genes], each gene in units of its range."""
    scaled = jax.tree.map(
        lambda leaf, low, high: (leaf - low) / np.maximum(high - low, np.float32(1e-9)),
        *jax.device_get((genomes, box.low, box.high)),
    )
    return np.concatenate([leaf.reshape(len(leaf), -1) for leaf in jax.tree.leaves(scaled)], 1)


def uniform(key: jax.Array, box: Box, count: int) -> Any:
    """Draw genomes [count, ...] uniformly from the box."""
    return _draw(key, box, count, lambda key, shape: jax.random.uniform(key, shape))


def latin_hypercube(key: jax.Array, box: Box, count: int) -> Any:
    """Draw genomes [count, ...], one value of every gene in each of `count` slices of its range.

    Source: McKay, Beckman & Conover 1979.
    """

    def draw(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
        key_slice, key_within = jax.random.split(key)
        slices = jax.random.permutation(
            key_slice,
            jnp.broadcast_to(jnp.arange(count)[:, None], (count, math.prod(shape[1:]))),
            independent=True,
        )
        return ((slices + jax.random.uniform(key_within, slices.shape)) / count).reshape(shape)

    return _draw(key, box, count, draw)


def jittered(
    key: jax.Array,
    values: jax.Array,
    low: jax.Array,
    high: jax.Array,
    rate: jax.Array | float,
    sigma: jax.Array | float,
) -> jax.Array:
    """Move each value [E] with probability `rate` by a Gaussian of `sigma` ranges.

    Results are clipped to the box.
    """
    key_which, key_by = jax.random.split(key)
    moved = values + sigma * (high - low) * jax.random.normal(key_by, values.shape)
    return jnp.clip(
        jnp.where(jax.random.bernoulli(key_which, rate, values.shape), moved, values), low, high
    )


def first_occurrence(genomes: object) -> jax.Array:
    """Return for each genome [N] (leaves [N, ...]) whether it is the first of its kind.

    Sorts by a random projection, so the cost grows as N log N. Equal genomes have equal
    projections; neighbours are compared in full.
    """
    rows = jnp.concatenate(
        [leaf.reshape(leaf.shape[0], -1) for leaf in jax.tree.leaves(genomes)], axis=1
    )
    # Elementwise product and sum treat all rows alike: a matrix product may round equal rows
    # differently at different places.
    projection = jnp.sum(rows * jax.random.normal(key_of(0), (rows.shape[1],)), axis=1)
    order = jnp.argsort(projection, stable=True)
    in_order = rows[order]
    repeats = jnp.concatenate([jnp.array([False]), jnp.all(in_order[1:] == in_order[:-1], axis=1)])
    return jnp.zeros(len(order), bool).at[order].set(~repeats)


def _draw(
    key: jax.Array, box: Box, count: int, draw: Callable[[jax.Array, tuple[int, ...]], jax.Array]
) -> Any:
    lows, structure = jax.tree.flatten(box.low)
    highs = jax.tree.leaves(box.high)
    keys = jax.random.split(key, len(lows))
    leaves = [
        low + (high - low) * draw(k, (count, *low.shape))
        for k, low, high in zip(keys, lows, highs, strict=True)
    ]
    return jax.tree.unflatten(structure, leaves)
