"""Jobs for workers: pure work on one recipe, with the same bits on all machines of a kind."""

import dataclasses
from collections.abc import Mapping
from typing import Protocol, TypeVar

import numpy as np
from typing_extensions import override

from mjxgait.champion import Champion
from mjxgait.distributed.recipe import Programs, Recipe
from mjxgait.evolution.state import EvolutionState, stop_reason
from mjxgait.tasks.starts import Starts
from mjxgait.training.advance import Generations, versions
from mjxgait.training.checkpoint import Packed, pack
from mjxgait.training.experiment import Batch, one_row
from mjxgait.training.folder import Line
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
    last generation. note: see `Experiment.plant_note`.
    seconds: of the generations, without compilation. steps: useful creature-steps in them.
    """

    packed: Packed
    lines: list[Lines]
    note: str
    seconds: float
    steps: int
    champions: Mapping[int, Champion] = dataclasses.field(default_factory=dict)


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
        generations = Generations(programs.step(recipe), batch, self._begun(batch))
        lines: list[Lines] = []
        champions: dict[int, Champion] = {}
        while generations.generation < self.until:
            lines += filter(None, [generations.advance()])
            for row, experiment in enumerate(batch.experiments):
                if generations.generation == experiment.config.evolution.generations:
                    champions[row] = experiment.champion(generations.row(row), versions())
        return _advanced(generations, pack(generations.states), batch, lines, champions)

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
        state = begun or one.init(self.island)
        generations = Generations(programs.step(recipe), batch, one_row(state))
        lines: list[Lines] = []
        while generations.generation < self.until:
            if new := generations.advance():
                lines.append(new)
                if stop_reason(generations.row(), one.config.evolution):
                    break
        return _advanced(generations, pack(generations.row()), batch, lines)


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


def _advanced(
    generations: Generations,
    packed: Packed,
    batch: Batch,
    lines: list[Lines],
    champions: Mapping[int, Champion] | None = None,
) -> Advanced:
    note, seconds, steps = batch.experiments[0].plant_note, generations.seconds, generations.steps
    return Advanced(packed, lines, note, seconds, steps, champions or {})
