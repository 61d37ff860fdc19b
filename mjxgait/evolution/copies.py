"""Who is a copy of somebody else, of whom only one survives.

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
    """Whether each of the old and the offspring [P + M] is the first of its kind: who is judged anew
    comes before its old self, and of the same verdict a child before its parent, so that what does
    nothing drifts.

    Args:
      same: what makes a copy, `evolution.same`. verdicts: [M, R, F] terms of this round alone; who
        has none is no first. anew: [] whether the first of the offspring are old ones.
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
    """One after the other: leaves [P + M, ...] of leaves [P, ...] and [M, ...]."""
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), old, new)


def _new_first(old: Any, new: Any) -> jax.Array:
    """Whether each of both [P + M] is the first of its kind, the new before the old."""
    return jnp.roll(first_occurrence(together(new, old)), len(jax.tree.leaves(old)[0]))
