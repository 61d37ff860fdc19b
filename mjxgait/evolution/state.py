"""State of evolution from generation to generation, and its metrics."""

from enum import IntEnum
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.evolution.strategy import Normal
from mjxgait.evolution.variation import first_occurrence
from mjxgait.types import Evaluation, pytree

NO_PARENT = -1
"""Place of a mother or a father that an individual does not have, or that is unknown."""


class Origin(IntEnum):
    """Origin of an individual."""

    INITIAL = 0
    CROSSOVER = 1
    MUTATION = 2
    NEWCOMER = 3
    DRAWN = 4


@pytree
class EvolutionState:
    """State that the next generation reads; the population is sorted, best first, once evaluated.

    genomes: leaves [P, ...]. terms: [P, R, F]. outcome: [P, R, O]. fitness: [P]. born: [P]
    generation of birth. origin: [P] an `Origin`.
    key: for all future random numbers. generation: [] -1 while seeding. seeded: [] number of the
    initial population evaluated so far.
    best_history, mean_history: [W = window + 1] of the latest generations, newest last. quiet: []
    generations since the last forced phase.
    forced: [] whether the next generation is forced. spell_age, refreshed: [] of the current phase.
    spell_best: [] best fitness when the last phase began. barren: [] phases in a row that began
    without a better best than the one before.
    rounds: [P] of which `terms` is the mean; None where earlier rounds do not count.
    level: [] number of times the trials have become harder; None without a curriculum.
    stale: [] whether they have since `terms` were evaluated; None likewise.
    family: [P] first-generation ancestor along the mothers; None where a lineage may be of any
    size.
    normal: what an evolution strategy has learnt; None for the genetic algorithm.
    """

    genomes: Any
    terms: jax.Array
    outcome: jax.Array
    fitness: jax.Array
    born: jax.Array
    origin: jax.Array
    key: jax.Array
    generation: jax.Array
    seeded: jax.Array
    best_history: jax.Array
    mean_history: jax.Array
    quiet: jax.Array
    forced: jax.Array
    spell_age: jax.Array
    refreshed: jax.Array
    spell_best: jax.Array
    barren: jax.Array
    rounds: jax.Array | None = None
    level: jax.Array | None = None
    stale: jax.Array | None = None
    family: jax.Array | None = None
    normal: Normal | None = None


@pytree
class GenerationMetrics:
    """Metrics of a generation: scalars except best_terms [F] and best_outcome [O].

    best_terms, best_outcome: mean over the trials of the best individual. unique: different
    genomes. spread: standard deviation over the population, in the units of each array of the
    genome: mean over an array's genes, then over the arrays. failures: number of the offspring's
    episodes that ended early. mothers: [P] places of the population, or of its mothers, in the
    generation before; fathers: [P] places there of the fathers of those born in this generation,
    else `NO_PARENT`; None where that is not recorded. level: of the next generation's trials; None
    without a curriculum. best to worst: fitness of the population. forced: whether this generation
    was. evaluations: offspring. episodes: those simulated to an end. sim_steps: of episodes;
    computed_steps: with those of idle lanes.
    """

    generation: jax.Array
    best: jax.Array
    mean: jax.Array
    median: jax.Array
    lower_quartile: jax.Array
    upper_quartile: jax.Array
    worst: jax.Array
    unique: jax.Array
    spread: jax.Array
    forced: jax.Array
    failures: jax.Array
    episodes: jax.Array
    evaluations: jax.Array
    sim_steps: jax.Array
    computed_steps: jax.Array
    best_terms: jax.Array
    best_outcome: jax.Array
    mothers: jax.Array | None = None
    fathers: jax.Array | None = None
    level: jax.Array | None = None


@pytree
class Proposal:
    """Offspring that a generation submits for evaluation.

    key: of the next generation. offspring: leaves [M, ...]; origin, born: [M]. mothers: [M] places
    of their first parents, or `NO_PARENT`; fathers: [M] of their second, or `NO_PARENT`; None where
    that is not recorded.
    """

    key: jax.Array
    offspring: Any
    origin: jax.Array
    born: jax.Array
    mothers: jax.Array | None = None
    fathers: jax.Array | None = None


def stop_reason(state: EvolutionState, config: EvolutionConfig) -> str | None:
    """Explain in words why a run ends after this generation; None while it continues.

    Reads the state on the host.
    """
    if config.target is not None and float(state.fitness[0]) >= config.target:
        return f"the target fitness of {config.target:g} is reached"
    if (
        config.forced.enabled
        and config.forced.patience
        and int(state.barren) >= config.forced.patience
    ):
        count = int(state.barren)
        last = "the last phase" if count == 1 else f"the last {count} phases"
        return f"forced evolution no longer pays: no growth in {last}"
    if int(state.generation) >= config.generations:
        return f"all {config.generations} generations are done"
    return None


def metrics(
    config: EvolutionConfig,
    state: EvolutionState,
    evaluation: Evaluation,
    forced: jax.Array,
    mothers: jax.Array | None,
    fathers: jax.Array | None,
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
        failures=jnp.sum(evaluation.failed),
        episodes=jnp.sum(evaluation.failed | jnp.isfinite(evaluation.terms).all(-1)),
        evaluations=jnp.int32(config.offspring),
        sim_steps=evaluation.sim_steps,
        computed_steps=evaluation.computed_steps,
        best_terms=jnp.mean(state.terms[0], axis=0),
        best_outcome=jnp.mean(state.outcome[0], axis=0),
        mothers=mothers,
        fathers=fathers,
    )


def finite_mean(values: jax.Array) -> jax.Array:
    """Return the mean [] of the finite values [N]; -inf if none is finite."""
    finite = jnp.isfinite(values)
    return jnp.where(
        jnp.any(finite),
        jnp.sum(jnp.where(finite, values, 0.0)) / jnp.maximum(jnp.sum(finite), 1),
        -jnp.inf,
    )
