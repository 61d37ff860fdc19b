"""Children of a generation, of two parents each.

Letters: `P` population, `M` offspring.
"""

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.evolution.breeding import SequentialBreeding, parents, proportional_parents
from mjxgait.evolution.state import NO_PARENT, EvolutionState, Origin
from mjxgait.evolution.variation import Variation
from mjxgait.types import choose

Parents = tuple[jax.Array, jax.Array]
"""Places [M] of mothers and fathers in the population; see `Proposal`."""


def children(
    key: jax.Array, config: EvolutionConfig, variation: Variation, state: EvolutionState
) -> tuple[object, jax.Array, Parents | None]:
    """Return genomes [M, ...], origins and parents' places; no places in sequential breeding."""
    count = config.offspring
    if config.pool == "growing" or config.unique_children:
        bred, of_two = SequentialBreeding(config, variation).children(key, state.genomes)
        return bred, jnp.where(of_two, int(Origin.CROSSOVER), int(Origin.MUTATION)), None
    key_parents, key_cross, key_whether, key_mutate, key_mutated = jax.random.split(key, 5)
    if config.proportional:
        mothers, fathers = proportional_parents(key_parents, count, state.fitness)
    else:
        mothers, fathers = parents(
            key_parents, count, config.population, config.selection, config.rivals
        )
    mother, father = (
        jax.tree.map(lambda leaf, i=i: leaf[i], state.genomes) for i in (mothers, fathers)
    )
    crossed = jax.vmap(variation.cross)(jax.random.split(key_cross, count), mother, father)
    crosses = jax.random.bernoulli(key_whether, config.crossover, (count,))
    child = choose(crosses, crossed, mother)
    mutated = jax.vmap(variation.mutate)(jax.random.split(key_mutate, count), child)
    # An unmutated child of one parent would be a duplicate; at rate 0 it is kept.
    mutates = jax.random.bernoulli(key_mutated, config.mutation_rate, (count,)) | (
        ~crosses & (config.mutation_rate > 0)
    )
    origin = jnp.where(crosses, int(Origin.CROSSOVER), int(Origin.MUTATION))
    both = mothers, jnp.where(crosses, fathers, NO_PARENT)
    return choose(mutates, mutated, child), origin, both
