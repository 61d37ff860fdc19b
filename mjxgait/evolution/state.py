"""State of evolution from generation to generation, its metrics, and forced evolution."""

import dataclasses
from enum import IntEnum
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig, RestartConfig
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
    best_history, mean_history: [W] of the latest generations, newest last. quiet: [] generations
    since the last forced phase.
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
    else
    `NO_PARENT`; None where that is not recorded. level: of the next generation's trials; None
    without a curriculum.
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
        return (
            f"forced evolution no longer pays: {int(state.barren)} spells in a row without growth"
        )
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


def admitted(
    config: EvolutionConfig, state: EvolutionState, fitness: jax.Array, candidates: jax.Array
) -> jax.Array:
    """Select the candidates [P + M] that a forced generation admits.

    These are fit enough, best first, up to the room left in the phase.
    """
    old = jnp.sort(fitness[: config.population])
    enough = old[
        jnp.floor(config.forced.accept * jnp.float32(config.population - 1)).astype(jnp.int32)
    ]
    fit = candidates & (fitness >= enough) & jnp.isfinite(fitness)
    place = jnp.argsort(jnp.argsort(jnp.where(fit, -fitness, jnp.inf), stable=True))
    return fit & (place < _room(config) - state.refreshed)


def _room(config: EvolutionConfig) -> jax.Array:
    return jnp.clip(
        jnp.round(config.forced.refresh * jnp.float32(config.population)),
        1,
        config.population - 1,
    )


def decided(whole: EvolutionConfig, state: EvolutionState) -> EvolutionState:
    """Begin a forced phase when best and mean stall over the window; end it when it is done."""
    config = whole.forced
    best, mean = state.fitness[0], finite_mean(state.fitness)
    bests, means = (
        jnp.append(state.best_history[1:], best),
        jnp.append(state.mean_history[1:], mean),
    )
    age = jnp.where(state.forced, state.spell_age + 1, 0)
    spent = (jnp.asarray(config.limit) > 0) & (age >= config.limit)
    ends = state.forced & (spent | (state.refreshed >= _room(whole)))
    quiet = jnp.where(state.forced | (state.generation <= 0), 0, state.quiet + 1)
    stalled = (quiet >= config.window) & ~_grown(bests, config.gain) & ~_grown(means, config.gain)
    begins = stalled & ~state.forced & config.enabled
    if state.normal is not None:  # an evolution strategy has no parents to mutate
        begins = jnp.zeros((), bool)
    first = ~jnp.isfinite(state.spell_best)
    pays = first | _grown(jnp.stack([state.spell_best, best]), config.gain)
    return dataclasses.replace(
        state,
        best_history=bests,
        mean_history=means,
        quiet=quiet,
        forced=begins | (state.forced & ~ends),
        spell_age=jnp.where(begins, 0, age).astype(jnp.int32),
        refreshed=jnp.where(begins, 0, state.refreshed).astype(jnp.int32),
        spell_best=jnp.where(begins, best, state.spell_best),
        barren=jnp.where(begins, jnp.where(pays, 0, state.barren + 1), state.barren).astype(
            jnp.int32
        ),
    )


def restarted(config: RestartConfig, state: EvolutionState, complete: jax.Array) -> EvolutionState:
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
        begun_anew(state, now),
        seeded=jnp.where(now, 0, state.seeded),
        forced=state.forced & ~now,
        rounds=reset(state.rounds, jnp.ones(count)),
        family=reset(state.family, jnp.arange(count)),
    )


def begun_anew(state: EvolutionState, now: jax.Array) -> EvolutionState:
    """Where now [], forget earlier growth: every individual's fitness has changed.

    The window then begins with the next generation, because this one's best is still a fitness of
    the old trials.
    """
    return dataclasses.replace(
        state,
        quiet=jnp.where(now, -1, state.quiet),
        barren=jnp.where(now, 0, state.barren),
        spell_best=jnp.where(now, -jnp.inf, state.spell_best),
    )


def _grown(history: jax.Array, gain: jax.Array | float) -> jax.Array:
    return history[-1] - history[0] > gain * jnp.maximum(jnp.abs(history[0]), 1.0)
