"""Parts of a generation of a batch of runs: propose, evaluate (and promote), absorb.

All but the simulations goes row by row, so that a row is independent of the others, unless it
receives migrants from them.
"""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.schema import Config
from mjxgait.evolution.evolution import Evolution
from mjxgait.evolution.forced import with_stagnation_reset
from mjxgait.evolution.state import NO_PARENT, EvolutionState, GenerationMetrics, Proposal
from mjxgait.simulation.evaluator import LocalEvaluator
from mjxgait.simulation.rollout import Simulator
from mjxgait.tasks.base import Task, in_order
from mjxgait.tasks.starts import Starts
from mjxgait.tasks.terms import score
from mjxgait.training.simulator import BodyParams, SimulatorSpec
from mjxgait.types import Evaluation, RequestedTrials, choose, pytree

LEADERS = 16
"""Number of a row's best individuals that decide on the next curriculum level."""
SENT = 4
"""Number of a row's best individuals that migrate to other rows in turn, one per generation."""


@pytree
class RunParams:
    """Inputs that differ between runs of one compiled program: traced settings and all starts.

    sources: [S] rows whose best are evaluated among its children; its own number means no row.
      None if rows are independent.
    """

    settings: Config
    starts: Starts
    sources: jax.Array | None = None


def evolution_of(simulator: Simulator, settings: Config) -> Evolution:
    """Return the genetic algorithm with these settings, plain or traced."""
    task = simulator.task

    def rank(terms: jax.Array, generation: jax.Array) -> jax.Array:
        weights = in_order(task.weights(settings.fitness, generation), task.terms)
        return score(terms, weights, settings.rollout.worst, settings.rollout.caution)

    variation = simulator.controller.variation(settings.controller, settings.evolution)
    return Evolution(settings.evolution, variation, rank, hold=settings.rollout.hold)


def first_state(
    spec: SimulatorSpec, numbers: BodyParams | None, settings: Config, key: jax.Array
) -> EvolutionState:
    """Return the state of a run before the first evaluation."""
    simulator = spec.simulator(numbers)
    task, trials = simulator.task, settings.rollout.starts
    state = evolution_of(simulator, settings).init(key, trials, len(task.terms), len(task.outcomes))
    if not task.has_curriculum:
        return state
    return dataclasses.replace(state, level=jnp.int32(0), stale=jnp.zeros((), bool))


def propose(
    spec: SimulatorSpec, numbers: BodyParams | None, rows: RunParams, states: EvolutionState
) -> tuple[Proposal, Starts]:
    """Return the proposals of the rows [B], and the starts [B, R] to evaluate them on."""
    simulator = spec.simulator(numbers)

    def of_row(pair: tuple[RunParams, EvolutionState]) -> Proposal:
        row, state = pair
        return evolution_of(simulator, row.settings).propose(state)

    proposals = jax.lax.map(of_row, (rows, states))
    if rows.sources is not None:
        proposals = with_migrants(rows.sources, states, proposals)
    return proposals, jax.vmap(partial(next_starts, simulator.task))(rows, states)


def with_migrants(sources: jax.Array, states: EvolutionState, proposals: Proposal) -> Proposal:
    """Replace the last children of the proposals [B] by one of the best of each source [B, S].

    Rows differ in their settings, so migrants are evaluated again. None migrates before the first
    evaluation of the rows.
    """
    count, own = sources.shape[1], jnp.arange(len(sources))[:, None]
    evaluated = states.generation[:, None] >= 0
    comes, rank = (sources != own) & evaluated, states.generation[:, None] % SENT

    def seated(children: jax.Array, best: jax.Array) -> jax.Array:
        guests, last = best[sources, rank % best.shape[1]], children[:, -count:]
        return children.at[:, -count:].set(choose(comes, guests, last))

    mothers, fathers = proposals.mothers, proposals.fathers
    if mothers is not None:
        mothers = seated(mothers, jnp.full_like(states.origin, NO_PARENT))
    if fathers is not None:
        fathers = seated(fathers, jnp.full_like(states.origin, NO_PARENT))
    return dataclasses.replace(
        proposals,
        offspring=jax.tree.map(seated, proposals.offspring, states.genomes),
        origin=seated(proposals.origin, states.origin),
        mothers=mothers,
        fathers=fathers,
    )


def evaluate(
    spec: SimulatorSpec,
    numbers: BodyParams | None,
    settings: Config,
    starts: Starts,
    genomes: object,
    requested: RequestedTrials | None = None,
) -> Evaluation:
    """Evaluate genomes [B, N, ...] on this machine."""
    return LocalEvaluator(spec.simulator(numbers)).evaluate(genomes, starts, settings, requested)


def evaluate_small(
    spec: SimulatorSpec,
    numbers: BodyParams | None,
    settings: Config,
    starts: Starts,
    genomes: object,
    requested: RequestedTrials,
) -> RequestedTrials:
    """Evaluate the small bodies among genomes [B, N, ...]; return the request of the others."""
    assert spec.small is not None
    return spec.small.evaluate(genomes, starts, settings, requested)


def first_trials(states: EvolutionState, proposals: Proposal) -> RequestedTrials:
    """Request the first trial of every individual, with no known results; reads shapes only."""
    every = all_trials(states, proposals)
    first = np.arange(states.terms.shape[2]) == 0
    return RequestedTrials(np.broadcast_to(first, every.wanted.shape), every.known)


def all_trials(states: EvolutionState, proposals: Proposal) -> RequestedTrials:
    """Request all trials of every individual, with no known results; reads shapes only."""
    shape = (*proposals.born.shape, states.terms.shape[2])

    def nothing(values: jax.Array) -> Any:
        return np.full((*shape, values.shape[-1]), np.nan, np.float32)

    failed: Any = np.zeros(shape, bool)
    spent: Any = np.zeros(shape[0], np.int32)
    known = Evaluation(nothing(states.terms), nothing(states.outcome), failed, spent, spent)
    return RequestedTrials(np.ones(shape, bool), known)


def promote(
    spec: SimulatorSpec,
    numbers: BodyParams | None,
    rows: RunParams,
    states: EvolutionState,
    proposals: Proposal,
    evaluation: Evaluation,
) -> RequestedTrials:
    """Request the other trials of the best in the first, and of individuals evaluated again."""
    simulator = spec.simulator(numbers)

    def of_row(given: tuple[RunParams, EvolutionState, Proposal, Evaluation]) -> jax.Array:
        row, state, proposal, evaluation = given
        share = row.settings.rollout.promote
        return evolution_of(simulator, row.settings).promising(state, proposal, evaluation, share)

    wanted = jax.lax.map(of_row, (rows, states, proposals, evaluation))
    others = jnp.arange(states.terms.shape[2]) > 0
    return RequestedTrials(wanted[..., None] & others, evaluation)


def absorb(
    spec: SimulatorSpec,
    numbers: BodyParams | None,
    rows: RunParams,
    states: EvolutionState,
    proposals: Proposal,
    evaluation: Evaluation,
) -> tuple[EvolutionState, GenerationMetrics]:
    """Complete the generation of the rows after the evaluation."""
    simulator = spec.simulator(numbers)

    def of_row(
        given: tuple[RunParams, EvolutionState, Proposal, Evaluation],
    ) -> tuple[EvolutionState, GenerationMetrics]:
        row, state, proposal, evaluation = given
        after, logged = evolution_of(simulator, row.settings).absorb(state, proposal, evaluation)
        after = with_level_raised(simulator.task, row.settings.fitness, after)
        return after, dataclasses.replace(logged, level=after.level)

    return jax.lax.map(of_row, (rows, states, proposals, evaluation))


def with_level_raised(task: Task, settings: object, state: EvolutionState) -> EvolutionState:
    """Raise the curriculum level after a generation if most of the best have passed it.

    The old level was easier, so fitness at that level is then discarded: all survivors are
    evaluated again, and their lower fitness does not count as stagnation. The highest level stays.
    """
    if state.level is None:
        return state
    best = dict(zip(task.terms, jnp.mean(state.terms[:LEADERS], axis=1).T, strict=True))
    known = (state.generation >= 0) & jnp.isfinite(state.fitness[:LEADERS])
    ready = jnp.mean(jax.vmap(task.level_passed)(best) & known) > 0.5
    higher = ready & (state.level < task.levels(settings))
    rounds = None if state.rounds is None else jnp.where(higher, 0.0, state.rounds)
    after = with_stagnation_reset(state, higher)
    return dataclasses.replace(after, level=state.level + higher, stale=higher, rounds=rounds)


def next_starts(task: Task, row: RunParams, state: EvolutionState) -> Starts:
    """Return the starts [R] of the next generation, at its curriculum level."""
    starts = row.starts
    if row.settings.rollout.variety > 1:
        generation = jnp.maximum(state.generation + 1, 0)
        starts = _of_round(row, generation // row.settings.rollout.hold)
    if state.level is None:
        return starts
    return task.at_level(starts, row.settings.fitness, state.level)


def _of_round(row: RunParams, number: jax.Array) -> Starts:
    """Return the nominal start and the disturbed starts of a round."""
    others = row.settings.rollout.starts - 1
    turn = 1 + (number * others + jnp.arange(others)) % (row.starts.friction.shape[0] - 1)
    places = jnp.append(0, turn)
    return jax.tree.map(lambda leaf: leaf[places], row.starts)
