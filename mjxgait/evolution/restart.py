"""A new beginning for a population that has learnt nothing."""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import RestartConfig
from mjxgait.evolution.forced import with_stagnation_reset
from mjxgait.evolution.state import EvolutionState


def with_restart(
    config: RestartConfig, state: EvolutionState, complete: jax.Array
) -> EvolutionState:
    """Where the best has learnt nothing by now, let the next generation be a first one.

    The population stays in the state until then, and nothing of it is kept.

    complete: [] whether the first population, or that of the last restart, is all evaluated.
    """
    every = jnp.asarray(config.every)
    due = (every > 0) & (state.generation > 0) & (state.generation % jnp.maximum(every, 1) == 0)
    now = due & complete & (state.fitness[0] <= config.below)
    count = state.fitness.shape[0]

    def reset(old: jax.Array | None, new: jax.Array) -> jax.Array | None:
        return None if old is None else jnp.where(now, new, old)

    return dataclasses.replace(
        with_stagnation_reset(state, now),
        seeded=jnp.where(now, 0, state.seeded),
        forced=state.forced & ~now,
        rounds=reset(state.rounds, jnp.ones(count)),
        family=reset(state.family, jnp.arange(count)),
    )
