"""Generations without simulation, for tests of everything around them."""

import contextlib
import dataclasses
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np

from mjxgait.champion import Champion
from mjxgait.distributed.jobs import Advanced, AdvanceRows, Programs, Recipe
from mjxgait.distributed.scheduler import LocalBackend, Report
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.simulation.evaluator import Evaluator
from mjxgait.training.advance import Generations
from mjxgait.training.checkpoint import pack
from mjxgait.training.experiment import Batch, Experiment, one_row, row_of
from mjxgait.training.prescreen import Prescreen


def unevolved(
    run: Batch, evaluator: Evaluator | None, restored: EvolutionState | None, initial: object
) -> Generations:
    """Stand in for `loop._compiled`: the first population stays, and no program is compiled.

    Body, settings, initial conditions and genomes are made as in a real run.
    """
    (experiment,) = run.experiments
    step = partial(generation, follows=experiment.config.evolution.follows)
    return Generations(step, run, one_row(embodied(experiment) if restored is None else restored))


def embodied(experiment: Experiment) -> EvolutionState:
    """Return the first state, rotated until its first genome grows a body that can move."""
    state = experiment.init()
    genomes = jax.device_get(state.genomes)
    known = dataclasses.replace(state, fitness=np.zeros(state.fitness.shape, np.float32))
    for place in range(len(state.fitness)):
        turned = jax.tree.map(partial(np.roll, shift=-place, axis=0), genomes)
        with contextlib.suppress(UserError):
            champion = experiment.champion(dataclasses.replace(known, genomes=turned), {})
            champion.embodied(experiment.creature)
            return dataclasses.replace(state, genomes=turned)
    raise AssertionError("none of the first population can move")


def untried(prescreen: Prescreen) -> Callable[..., SimpleNamespace]:
    """Stand in for `Prescreen._program`: made-up metrics, and no program is compiled."""
    names = prescreen._trials.simulator.task.outcomes

    def evaluation(numbers: Any, settings: Any, starts: Any, genomes: Any) -> SimpleNamespace:
        individuals, trials = (jax.tree.leaves(rows)[0].shape[1] for rows in (genomes, starts))
        outcome = np.broadcast_to(_made_up(len(names)), (1, individuals, trials, len(names)))
        return SimpleNamespace(outcome=outcome)

    return evaluation


def _made_up(count: int) -> np.ndarray:
    """Metrics that are nonzero and all different: some are divided by a difference."""
    return 0.25 + 0.01 * np.arange(count, dtype=np.float32)


def generation(
    states: EvolutionState, follows: bool = False
) -> tuple[EvolutionState, GenerationMetrics]:
    """Return the same population of one row, one generation later, and metrics of ones."""
    state = row_of(jax.device_get(states))
    outcomes = _made_up(state.outcome.shape[-1])
    later = dataclasses.replace(
        state,
        terms=np.zeros_like(state.terms),
        outcome=np.broadcast_to(outcomes, state.outcome.shape),
        fitness=np.zeros_like(state.fitness),
        generation=state.generation + 1,
    )
    names = {field.name for field in dataclasses.fields(GenerationMetrics)}
    numbers = dict.fromkeys(names - {"mothers", "fathers", "level"}, np.ones(()))
    known = {
        "generation": later.generation,
        "forced": np.zeros((), bool),
        "best_terms": np.zeros(state.terms.shape[-1]),
        "best_outcome": np.zeros(state.outcome.shape[-1]),
        "mothers": np.zeros(state.fitness.shape, np.int32) if follows else None,
        "fathers": np.full(state.fitness.shape, -1, np.int32) if follows else None,
    }
    metrics = GenerationMetrics(**(numbers | known), level=state.level)
    return one_row((later, metrics))


class Unevolved(LocalBackend):
    """A worker without evolution: champions are the first of the first population.

    Bodies, settings, initial conditions and genomes are real; no generation is compiled.
    """

    def wait(self, seconds: float) -> list[Report]:
        """See `Backend`."""
        if self._work is None:
            return []
        (worker, recipe, job), self._work = self._work, None
        return [Report(worker, first_population(self._programs, recipe, job))]


def first_population(programs: Programs, recipe: Recipe, job: AdvanceRows) -> Advanced:
    """Return the result of an evolution without progress."""
    batch = programs.batch(recipe)
    packed = job.state or pack(batch.init())
    rows = range(len(batch.experiments))
    begun = -1 if job.state is None else job.state.generation
    lines = [[line_of(g) for _ in rows] for g in range(begun + 1, job.until + 1)]
    arrays: dict[str, Any] = {"generation": np.full(len(rows), job.until, np.int32)}
    arrays |= {name: np.zeros_like(packed.arrays[name]) for name in ("fitness", "terms", "outcome")}
    after = packed.with_arrays(arrays)
    ends = [row for row in rows if batch.experiments[row].config.evolution.generations == job.until]
    champions = {row: champion_of(batch.experiments[row]) for row in ends}
    return Advanced(after, lines, "", 1.0, len(rows), champions)


def line_of(generation: int) -> dict[str, Any]:
    """Return a log line of a run without progress."""
    counts = {"sim_steps": 10, "failures": 0, "episodes": 4}
    values = {"best": 0.5, "mean": 0.25, "forced": False, "term_distance": 0.5}
    return {"generation": generation} | counts | values


def champion_of(experiment: Experiment) -> Champion:
    """Return the first genome of the first population."""
    state = experiment.init()
    known = {"fitness": np.ones_like(state.fitness), "terms": np.zeros_like(state.terms)}
    return experiment.champion(dataclasses.replace(state, **known), {})
