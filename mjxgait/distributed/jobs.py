"""Jobs for workers: pure work on one recipe, with the same bits on all machines of a kind."""

import dataclasses
import time
from collections.abc import Iterator, Mapping
from typing import Any, Protocol, TypeVar

import jax
import numpy as np
from typing_extensions import override

from mjxgait.champion import Champion
from mjxgait.distributed.recipe import Programs, Recipe
from mjxgait.evolution.state import EvolutionState, GenerationMetrics, stop_reason
from mjxgait.tasks.starts import Starts
from mjxgait.training.checkpoint import Packed, pack
from mjxgait.training.experiment import Batch, Step
from mjxgait.training.folder import Line
from mjxgait.training.loop import followed, metrics_line, versions
from mjxgait.types import Evaluation, RequestedTrials

Lines = list[Line]
Result_co = TypeVar("Result_co", covariant=True)


class Job(Protocol[Result_co]):
    """Work on a recipe."""

    def do(self, programs: Programs, recipe: Recipe) -> Result_co:
        """Return the result, in NumPy."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Advanced:
    """Result of advancing evolution.

    lines: of the metrics, a list [B] per generation. champions: of rows that have reached their
    last generation. note: see `Experiment.plant_note`. reason: why the run is over, if it is.
    seconds: of the generations, without compilation. steps: useful creature-steps in them.
    """

    packed: Packed
    lines: list[Lines]
    note: str
    seconds: float
    steps: int
    champions: Mapping[int, Champion] = dataclasses.field(default_factory=dict)
    reason: str | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class AdvanceRows(Job[Advanced]):
    """Advance runs side by side to a generation, from a state or from the beginning.

    planted: arrays [B, P, ...] of the initial genomes by name, in place of random ones.
    """

    state: Packed | None
    until: int
    planted: Mapping[str, np.ndarray] | None = None

    @override
    def do(self, programs: Programs, recipe: Recipe) -> Advanced:
        batch = programs.batch(recipe)
        done = _Generations(programs.step(recipe), batch, self._begun(batch), self.until)
        champions: dict[int, Champion] = {}
        for _ in done:
            for row, experiment in enumerate(batch.experiments):
                if done.generation == experiment.config.evolution.generations:
                    champions[row] = experiment.champion(_row(done.states, row), versions())
        return done.advanced(pack(done.states), champions=champions)

    def _begun(self, batch: Batch) -> EvolutionState:
        if self.state is None and self.planted is None:
            return batch.init()
        begun = self.state or pack(batch.init()).with_arrays(self.planted or {})
        return begun.state(batch.abstract(), "a state of these runs")


@dataclasses.dataclass(frozen=True, eq=False)
class AdvanceIsland(Job[Advanced]):
    """Advance one population of a run to a generation or its end, from a state or anew."""

    state: Packed | None
    until: int
    island: int

    def do(self, programs: Programs, recipe: Recipe) -> Advanced:
        """The state is packed without the row axis, as in a run's checkpoint."""
        batch = programs.batch(recipe)
        one = batch.experiments[0]
        begun = self.state and self.state.state(one.abstract(), "an island's state")
        state, reason = begun or one.init(self.island), None
        alone = jax.tree.map(lambda leaf: leaf[None], state)
        done = _Generations(programs.step(recipe), batch, alone, self.until)
        for lines in done:
            state = jax.tree.map(lambda leaf: leaf[0], done.states)
            lines[0] |= followed(one.simulator.controller.numbers(state.genomes))
            if reason := stop_reason(state, one.config.evolution):
                break
        return done.advanced(pack(state), reason=reason)


@dataclasses.dataclass(frozen=True, eq=False)
class Evaluate(Job[Evaluation]):
    """Evaluate genomes [1, N, ...] on starts [1, R], with leaves in NumPy.

    asked: see `Evaluator`.
    """

    genomes: object
    starts: Starts
    requested: RequestedTrials | None = None

    @override
    def do(self, programs: Programs, recipe: Recipe) -> Evaluation:
        evaluation: Evaluation = programs.evaluate(
            recipe, self.genomes, self.starts, self.requested
        )
        return evaluation


class _Generations:
    """Successive generations of one job and their metrics.

    states: of the latest generation.
    """

    def __init__(self, step: Step, batch: Batch, states: EvolutionState, until: int) -> None:
        self.step, self.batch, self.until = step, batch, until
        self.states = batch.place(states)
        self.generation = int(np.max(states.generation))
        self.seconds, self.steps = 0.0, 0
        self.lines: list[Lines] = []

    def __iter__(self) -> Iterator[Lines]:
        """Yield the metrics lines [B] of each generation."""
        task = self.batch.experiments[0].simulator.task
        while self.generation < self.until:
            began = time.perf_counter()
            self.states, found = self.step(self.states)
            metrics: GenerationMetrics = jax.device_get(found)
            seconds = time.perf_counter() - began
            self.seconds += seconds
            self.generation = int(np.max(metrics.generation))
            if self.generation < 0:
                continue
            self.steps += int(metrics.sim_steps.sum())
            each = (jax.tree.map(lambda a, i=i: a[i], metrics) for i in range(len(metrics.best)))
            self.lines.append([metrics_line(one, seconds, task) for one in each])
            yield self.lines[-1]

    def advanced(self, packed: Packed, **also: Any) -> Advanced:
        """Return the result of all generations."""
        note = self.batch.experiments[0].plant_note
        return Advanced(packed, self.lines, note, self.seconds, self.steps, **also)


def _row(states: EvolutionState, row: int) -> EvolutionState:
    """Return one row's state.

    A key cannot be indexed like other leaves; it is not needed, so a placeholder replaces it.
    """
    plain = dataclasses.replace(states, key=states.generation)
    return jax.tree.map(lambda leaf: leaf[row], plain)
