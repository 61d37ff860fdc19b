"""Metrics of a generation."""

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.evolution.variation import first_occurrence
from mjxgait.types import Judged


def metrics(
    config: EvolutionConfig,
    state: EvolutionState,
    judged: Judged,
    forced: jax.Array,
    mothers: jax.Array | None,
) -> GenerationMetrics:
    """Compute the metrics of a sorted state and the evaluation that led to it.

    forced: [] whether the generation was.
    """
    quartiles = jnp.nanpercentile(
        jnp.where(jnp.isfinite(state.fitness), state.fitness, jnp.nan),
        jnp.array([25, 50, 75]),
        method="nearest",
    )
    spreads = [jnp.mean(jnp.std(leaf, axis=0)) for leaf in jax.tree.leaves(state.genomes)]
    return GenerationMetrics(
        generation=state.generation,
        best=state.fitness[0],
        mean=finite_mean(state.fitness),
        median=quartiles[1],
        lower_quartile=quartiles[0],
        upper_quartile=quartiles[2],
        worst=state.fitness[-1],
        unique=jnp.sum(first_occurrence(state.genomes)),
        spread=sum(spreads, jnp.zeros(())) / len(spreads),
        forced=forced,
        failures=jnp.sum(judged.failed),
        episodes=jnp.sum(judged.failed | jnp.isfinite(judged.terms).all(-1)),
        evaluations=jnp.int32(config.offspring),
        sim_steps=judged.sim_steps,
        computed_steps=judged.computed_steps,
        best_terms=jnp.mean(state.terms[0], axis=0),
        best_outcome=jnp.mean(state.outcome[0], axis=0),
        mothers=mothers,
    )


def finite_mean(values: jax.Array) -> jax.Array:
    """Return the mean [] of the finite values [N]; -inf if none is finite."""
    finite = jnp.isfinite(values)
    return jnp.where(
        jnp.any(finite),
        jnp.sum(jnp.where(finite, values, 0.0)) / jnp.maximum(jnp.sum(finite), 1),
        -jnp.inf,
    )
