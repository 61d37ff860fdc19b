"""Detection of copies; only one of each survives.

Letters: `P` population, `M` offspring; `R`, `F` trials and terms.
"""

from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.evolution.state import EvolutionState, Proposal
from mjxgait.evolution.variation import Variation, first_occurrence


def first_of_kind(
    same: str,
    variation: Variation,
    state: EvolutionState,
    proposal: Proposal,
    verdicts: jax.Array,
    anew: jax.Array,
) -> jax.Array:
    """Tell for each of the old and the offspring [P + M] whether it is the first of its kind.

    An individual evaluated again comes before its old self. Of equal results, a child comes before
    its parent, so that neutral mutations drift.

    Args:
      same: definition of a copy, `evolution.same`. verdicts: [M, R, F] terms of this round alone;
        an individual without any is never first. anew: [] whether the first of the offspring are
        old ones.
    """
    old, new = state.genomes, proposal.offspring
    itself = _new_first(old, new)
    by_genome = jnp.where(anew, itself, first_occurrence(together(old, new)))
    if same == "genome":
        return by_genome
    of_old, of_new = state.terms, verdicts
    worth: Any = of_old, of_new
    if variation.price is not None:
        worth = (of_old, variation.price(old)), (of_new, variation.price(new))
    judged = jnp.isfinite(together(of_old, of_new)).all((1, 2))
    return jnp.where(state.forced, by_genome, _new_first(*worth) & judged & (itself | ~anew))


def together(old: Any, new: Any) -> Any:
    """Concatenate leaves [P, ...] and [M, ...] to [P + M, ...]."""
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), old, new)


def _new_first(old: Any, new: Any) -> jax.Array:
    """Tell for each of both [P + M] whether it is the first of its kind, the new before the old."""
    return jnp.roll(first_occurrence(together(new, old)), len(jax.tree.leaves(old)[0]))
