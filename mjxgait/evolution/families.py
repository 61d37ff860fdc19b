"""Lineages: limits that keep one family from filling the population.

Letters: `P` population, `M` offspring, `N` all of them.
"""

import jax
import jax.numpy as jnp

from mjxgait.evolution.state import NOBODY, EvolutionState


def families(state: EvolutionState, mothers: jax.Array | None) -> jax.Array | None:
    """Return the lineages [P + M] of the old and the offspring; None where they are not recorded.

    mothers: [M] places of the offspring's; an offspring without a mother begins a lineage.
    """
    if state.family is None or mothers is None:
        return None
    population, offspring = len(state.family), len(mothers)
    own = population + (state.generation + 2) * offspring + jnp.arange(offspring)
    theirs = state.family[jnp.maximum(mothers, 0)]
    return jnp.append(state.family, jnp.where(mothers == NOBODY, own, theirs))


def place_in_family(family: jax.Array, rank: jax.Array, counts: jax.Array) -> jax.Array:
    """Count [N] the counted members of its lineage that are before each, by rank [N] among all."""
    before = rank[:, None] > rank
    return jnp.sum(before & (family[:, None] == family) & counts, axis=1)


def with_share(
    family: jax.Array, most: int, tier: jax.Array, fitness: jax.Array, counts: jax.Array
) -> jax.Array:
    """Raise the tier [N] of the first `most` counted members of each lineage above all others.

    An old individual of another lineage thus survives before one more of a lineage that has its
    share.
    """
    rank = jnp.argsort(jnp.lexsort((-fitness, -tier)))
    return tier + 2 * (counts & (place_in_family(family, rank, counts) < most))
