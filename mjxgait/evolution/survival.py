"""Survival: the next population out of the old and the offspring, duplicates and lineages.

Letters: `P` population, `M` offspring, `N` both; `R`, `F` trials and terms.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.traced import chosen
from mjxgait.evolution.forced import admitted
from mjxgait.evolution.state import NO_PARENT, EvolutionState, Proposal
from mjxgait.evolution.variation import Variation, first_occurrence
from mjxgait.types import Evaluation, Tree, pytree


@pytree
class Pool:
    """The old and the offspring, one after the other: leaves [P + M, ...] of `EvolutionState`."""

    genomes: Any
    terms: jax.Array
    outcome: jax.Array
    born: jax.Array
    origin: jax.Array
    rounds: jax.Array | None


def pooled(
    state: EvolutionState, proposal: Proposal, evaluation: Evaluation, rounds: jax.Array | None
) -> Pool:
    """Return the old and the offspring. rounds: [M] of the offspring."""
    old = Pool(*(getattr(state, field.name) for field in dataclasses.fields(Pool)))
    new = Pool(
        proposal.offspring,
        evaluation.terms,
        evaluation.outcome,
        proposal.born,
        proposal.origin,
        rounds,
    )
    return together(old, new)


def families(state: EvolutionState, mothers: jax.Array | None) -> jax.Array | None:
    """Return the lineages [P + M] of the old and the offspring; None where they are not recorded.

    mothers: [M] places of the offspring's; an offspring without a mother begins a lineage.
    """
    if state.family is None or mothers is None:
        return None
    population, offspring = len(state.family), len(mothers)
    own = population + (state.generation + 2) * offspring + jnp.arange(offspring)
    theirs = state.family[jnp.maximum(mothers, 0)]
    return jnp.append(state.family, jnp.where(mothers == NO_PARENT, own, theirs))


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


def first_of_kind(
    same: str,
    variation: Variation,
    state: EvolutionState,
    proposal: Proposal,
    round_terms: jax.Array,
    anew: jax.Array,
) -> jax.Array:
    """Return for each of the old and the offspring [P + M] whether it is the first of its kind.

    An individual evaluated again comes before its old self. Of equal results, a child comes before
    its parent, so that neutral mutations drift.

    Args:
      same: definition of a copy, `evolution.same`. round_terms: [M, R, F] terms of this round
        alone; an individual without any is never first. anew: [] whether the first of the offspring are
        old ones.
    """
    old, new = state.genomes, proposal.offspring
    itself = _new_first(old, new)
    by_genome = jnp.where(anew, itself, first_occurrence(together(old, new)))
    if same == "genome":
        return by_genome
    of_old, of_new = state.terms, round_terms
    worth: tuple[object, object] = of_old, of_new
    if variation.price is not None:
        worth = (of_old, variation.price(old)), (of_new, variation.price(new))
    evaluated = jnp.isfinite(together(of_old, of_new)).all((1, 2))
    return jnp.where(state.forced, by_genome, _new_first(*worth) & evaluated & (itself | ~anew))


def together(old: Tree, new: Tree) -> Tree:
    """Concatenate leaves [P, ...] and [M, ...] to [P + M, ...]."""
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), old, new)


def _new_first(old: object, new: object) -> jax.Array:
    """Return for each of both [P + M] whether it is the first of its kind, the new first."""
    return jnp.roll(first_occurrence(together(new, old)), len(jax.tree.leaves(old)[0]))


@dataclasses.dataclass(frozen=True, eq=False)
class Survival:
    """Choice of the next population. config: plain or traced.

    anew: [] whether the first of the offspring are parents that were evaluated again; None where
    that never happens. stay: [] whether parents survive although otherwise only children do.
    """

    config: EvolutionConfig
    variation: Variation
    anew: jax.Array | None
    stay: jax.Array

    def survivors(
        self,
        state: EvolutionState,
        proposal: Proposal,
        pool: Pool,
        fitness: jax.Array,
        round_terms: jax.Array,
    ) -> tuple[EvolutionState, jax.Array]:
        """Return the P best of a pool without duplicates, and their places [P] in it.

        In a forced generation, offspring that are fit enough go before the old.

        Args:
          fitness: [P + M]. round_terms: [M, R, F] terms of this round alone.
        """
        config, places = self.config, jnp.arange(len(fitness))
        fresh = places >= config.population
        young = places >= config.population + config.elites
        anew = jnp.zeros((), bool) if self.anew is None else self.anew
        first = first_of_kind(config.same, self.variation, state, proposal, round_terms, anew)
        distinct = first | jnp.logical_not(config.remove_duplicates)
        taken_in = admitted(config, state, fitness, young & distinct)
        if self.anew is not None:  # The old were not simulated in this round.
            fitness = jnp.where(fresh | self.stay | ~anew, fitness, -jnp.inf)
        lives = distinct & (fresh | self.stay | chosen(config.survival, "best"))
        tier = jnp.where(state.forced & young, jnp.where(taken_in, 2, 0), jnp.where(lives, 1, 0))
        if not config.elites:  # the best always survives, whatever its tier
            tier = jnp.where((places == jnp.argmax(fitness)) & distinct, 3, tier)
        family = families(state, proposal.mothers)
        if family is not None:
            most = max(round(config.family * config.population), 1)
            fit = distinct & (taken_in | ~(state.forced & fresh))
            tier = with_share(family, most, tier, fitness, fit)
        kept = jnp.lexsort((-fitness, -tier))[: config.population]
        kept = kept[jnp.argsort(-fitness[kept], stable=True)]
        admitted_now = jnp.where(state.forced, jnp.sum(taken_in[kept]), 0)
        survived = dataclasses.replace(
            state,
            **vars(jax.tree.map(lambda leaf: leaf[kept], pool)),
            fitness=fitness[kept],
            family=None if family is None else family[kept],
            refreshed=(state.refreshed + admitted_now).astype(jnp.int32),
        )
        return survived, kept
