"""Selection of parents, and children born in order.

Sequential breeding follows the thesis: "Two parent genomes were chosen randomly from the population
and their pose combinations were permuted to produce unique children. The parents and children were
all returned into the population" (Wilson, 3.5). A child may have an elder sibling as its parent,
and each child differs from every genome before it.

Letters: `P` population, `M` offspring.
"""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.traced import Choice, chosen
from mjxgait.evolution.variation import Variation
from mjxgait.types import Tree, choose

TRIES = 16
"""Draws of a child that must be new; if all give existing genomes, the first is mutated."""


def parents(
    key: jax.Array,
    count: int,
    population: jax.Array | int,
    selection: str | Choice,
    rivals: int = 2,
) -> tuple[jax.Array, jax.Array]:
    """Draw places [count] of mothers and fathers in a population sorted best first.

    The two parents are never the same individual. `uniform` draws all alike; `rank` falls linearly
    to zero with rank (Baker 1985, pressure 2); `tournament` takes the best of `rivals`.
    """
    key_mother, key_father = jax.random.split(key)

    def draw(key: jax.Array, among: jax.Array | int) -> jax.Array:
        uniformly = jax.random.randint(key, (count,), 0, among)
        best = jnp.min(jax.random.randint(key, (count, rivals), 0, among), axis=1)
        by_rank = jnp.floor(among * (1 - jnp.sqrt(1 - jax.random.uniform(key, (count,))))).astype(
            jnp.int32
        )
        return jnp.where(
            chosen(selection, "uniform"),
            uniformly,
            jnp.where(chosen(selection, "tournament"), best, by_rank),
        )

    mothers, others = draw(key_mother, population), draw(key_father, population - 1)
    return mothers, others + (others >= mothers)


def proportional_parents(
    key: jax.Array, count: int, fitness: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Draw parents as `parents` does, each in proportion to its fitness [P] (Sims 1994).

    Individuals with fitness <= 0 are never selected, unless all have fitness <= 0.
    """
    key_mother, key_father = jax.random.split(key)
    share = jnp.where(fitness > 0, fitness, 0.0)
    share = jnp.where(jnp.any(share > 0), share, 1.0)
    mothers, fathers = (
        jax.random.categorical(key, jnp.log(share), shape=(count,))
        for key in (key_mother, key_father)
    )
    return mothers, jnp.where(fathers == mothers, (fathers + 1) % len(fitness), fathers)


@dataclasses.dataclass(frozen=True, eq=False)
class SequentialBreeding:
    """Sequential breeding of a generation's children. config: plain or traced; shapes are plain."""

    config: EvolutionConfig
    variation: Variation

    def children(self, key: jax.Array, adults: Tree) -> tuple[Tree, jax.Array]:
        """Return children [M, ...] of genomes [P, ...], best first, and which [M] are crossovers.

        A child that was mutated because no unique crossover was found does not count as crossover.
        """
        count = self.config.offspring
        pool = jax.tree.map(lambda leaf: _with_room(leaf, count), adults)

        def birth(pool: Tree, turn: tuple[jax.Array, jax.Array]) -> tuple[Tree, jax.Array]:
            place, key = turn
            child, of_two = self._child(key, pool, place)
            return jax.tree.map(lambda leaf, new: leaf.at[place].set(new), pool, child), of_two

        places = self.config.population + jnp.arange(count)
        pool, of_two = jax.lax.scan(birth, pool, (places, jax.random.split(key, count)))
        return jax.tree.map(lambda leaf: leaf[self.config.population :], pool), of_two

    def _child(self, key: jax.Array, pool: Tree, size: jax.Array) -> tuple[Tree, jax.Array]:
        """Return the next child of a pool that fills its first `size` [] places."""
        among = size if self.config.pool == "growing" else self.config.population
        if not self.config.unique_children:
            return self._draw(key, pool, among)
        key_draw, key_mutate = jax.random.split(key)
        drawn, of_two = jax.vmap(lambda key: self._draw(key, pool, among))(
            jax.random.split(key_draw, TRIES)
        )
        new = ~jax.vmap(lambda child: _holds(pool, size, child))(drawn)
        first = jnp.argmax(new)
        child = jax.tree.map(lambda leaf: leaf[first], drawn)
        mutant = self.variation.mutate(key_mutate, child)
        return choose(new[first], child, mutant), new[first] & of_two[first]

    def _draw(self, key: jax.Array, pool: Tree, among: jax.Array | int) -> tuple[Tree, jax.Array]:
        """Return a child of two or one of the first `among`, and whether it has two parents []."""
        config = self.config
        key_parents, key_cross, key_whether, key_mutate, key_mutated = jax.random.split(key, 5)
        mother, father = (
            jax.tree.map(lambda leaf, i=place[0]: leaf[i], pool)
            for place in parents(key_parents, 1, among, config.selection, config.rivals)
        )
        crosses = jax.random.bernoulli(key_whether, config.crossover)
        child = choose(crosses, self.variation.cross(key_cross, mother, father), mother)
        # As in simultaneous breeding: a child of one parent is always mutated, unless rate 0.
        mutates = jax.random.bernoulli(key_mutated, config.mutation_rate) | (
            ~crosses & (jnp.asarray(config.mutation_rate) > 0)
        )
        return choose(mutates, self.variation.mutate(key_mutate, child), child), crosses


def _with_room(leaf: jax.Array, count: int) -> jax.Array:
    return jnp.concatenate([leaf, jnp.zeros((count, *leaf.shape[1:]), leaf.dtype)])


def _holds(pool: object, size: jax.Array, genome: object) -> jax.Array:
    """Return whether [] one of the first `size` of a pool equals a genome."""
    same = [
        jnp.all(leaf == one, axis=tuple(range(1, leaf.ndim)))
        for leaf, one in zip(jax.tree.leaves(pool), jax.tree.leaves(genome), strict=True)
    ]
    everywhere = jnp.all(jnp.stack(same), axis=0)
    return jnp.any(everywhere & (jnp.arange(len(everywhere)) < size))
