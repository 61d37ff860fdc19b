"""Who descends from whom, so that not all of a population become one family.

Letters: `P` population, `M` offspring, `N` all of them.
"""

import jax
import jax.numpy as jnp

from mjxgait.evolution.state import NOBODY, EvolutionState


def families(state: EvolutionState, mothers: jax.Array | None) -> jax.Array | None:
    """[P + M] of the old and of the offspring; None where that is not followed.

    mothers: [M] places of the offspring's; who has none begins a family of its own.
    """
    if state.family is None or mothers is None:
        return None
    population, offspring = len(state.family), len(mothers)
    own = population + (state.generation + 2) * offspring + jnp.arange(offspring)
    theirs = state.family[jnp.maximum(mothers, 0)]
    return jnp.append(state.family, jnp.where(mothers == NOBODY, own, theirs))


def place_in_family(family: jax.Array, rank: jax.Array, counts: jax.Array) -> jax.Array:
    """[N] how many of its family that count are before each, by their rank [N] among all."""
    before = rank[:, None] > rank
    return jnp.sum(before & (family[:, None] == family) & counts, axis=1)


def with_share(
    family: jax.Array, most: int, tier: jax.Array, fitness: jax.Array, counts: jax.Array
) -> jax.Array:
    """The tiers [N], above all others those who count and are among the first so many of their
    family: sooner an old one of another family lives than one more of a family that has its share.
    """
    rank = jnp.argsort(jnp.lexsort((-fitness, -tier)))
    return tier + 2 * (counts & (place_in_family(family, rank, counts) < most))
