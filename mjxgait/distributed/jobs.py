"""Jobs for workers, and the recipes from which these build the programs of the runs."""

import dataclasses
import hashlib
import json
import tempfile
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from pathlib import Path
from typing import Protocol, TypeVar

import jax
import numpy as np
from typing_extensions import override

from mjxgait.champion import Champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.creature.load import creature_of
from mjxgait.evolution.state import EvolutionState, stop_reason
from mjxgait.lru import LruCache
from mjxgait.plugins import build_config
from mjxgait.plugins.user_code import is_loaded, load, loaded
from mjxgait.tasks.starts import Starts
from mjxgait.training.advance import Generations, versions
from mjxgait.training.checkpoint import Packed, pack
from mjxgait.training.experiment import Batch, ProgramKey, Step, build_batch, one_row, program_key
from mjxgait.training.logs import Line
from mjxgait.training.simulator import SimulatorSpec
from mjxgait.training.spec import make_spec
from mjxgait.training.stages import CompiledGeneration, Turn, at_once, compiled
from mjxgait.types import Evaluation, RequestedTrials


@dataclasses.dataclass(frozen=True)
class UserCode:
    """A user-defined controller or task: its class, and the file that it is in."""

    kind: str
    cls: str
    file: str
    source: str

    def load(self) -> None:
        """Load the class into this process."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / self.file
            path.write_text(self.source, encoding="utf-8")
            load(self.kind, f"{path}:{self.cls}")


@dataclasses.dataclass(frozen=True)
class Recipe:
    """A creature's files by name, the runs' settings as tables, and the user's own code.

    sources: see `build_batch`.
    """

    files: Mapping[str, str]
    tables: tuple[Mapping[str, object], ...]
    own: tuple[UserCode, ...] = ()
    sources: tuple[tuple[int, ...], ...] = ()

    @classmethod
    def of(
        cls, creature: Creature, configs: Sequence[Config], sources: Sequence[Sequence[int]] = ()
    ) -> "Recipe":
        """Make the recipe of runs of one program."""
        tables = tuple(dataclasses.asdict(config) for config in configs)
        known = tuple(map(tuple, sources))
        return cls(dict(creature.files), tables, tuple(_user_code(configs)), known)

    @cached_property
    def digest(self) -> str:
        """Hash of the whole recipe."""
        text = json.dumps(dataclasses.asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def read(self) -> tuple[Creature, list[Config]]:
        """Return the creature and the configs; load the user's own code."""
        for part in self.own:
            if not is_loaded(part.kind, f"{part.file}:{part.cls}"):
                part.load()
        configs = [build_config(table, "the settings that were sent") for table in self.tables]
        return creature_of(self.files), configs


def _user_code(configs: Sequence[Config]) -> Iterator[UserCode]:
    """Yield the loaded plugins that the configs use."""
    used = {name for config in configs for name in (config.use.controller, config.use.task)}
    for kind, text in loaded():
        place, _, cls = text.rpartition(":")
        path = Path(place)
        if f"{path.name}:{cls}" in used:
            yield UserCode(kind, cls, path.name, path.read_text(encoding="utf-8"))


KEPT = 8
"""Of each sort, the most recently used; a program takes some hundred MB."""


@dataclasses.dataclass(frozen=True)
class BatchKey:
    """Shape of runs side by side. rows: their number. sources: the most that one of them has."""

    run: ProgramKey
    rows: int
    sources: int

    def name(self, *more: Hashable) -> str:
        """See `ProgramKey.name`."""
        return self.run.name(self.rows, self.sources, *more)


class Programs:
    """Compiled programs of one process. turn: held while a program is compiled."""

    def __init__(self, turn: Turn = at_once) -> None:
        self._turn = turn
        self._batches: LruCache[tuple[BatchKey, Batch]] = LruCache(KEPT)
        self._specs: LruCache[SimulatorSpec] = LruCache(KEPT)
        self._stages: LruCache[CompiledGeneration] = LruCache(KEPT)
        self._evaluators: LruCache[jax.stages.Compiled] = LruCache(KEPT)

    def batch(self, recipe: Recipe) -> Batch:
        """Return the runs of a recipe."""
        return self._known(recipe)[1]

    def step(self, recipe: Recipe) -> Step:
        """Return the compiled generation of all runs of a recipe."""
        shape, batch = self._known(recipe)

        def turn(part: str) -> AbstractContextManager[object]:
            return self._turn(shape.name(part))

        return batch.bound(self._stages.find(shape, lambda: batch.stages(turn=turn)))

    def evaluate(
        self,
        recipe: Recipe,
        genomes: object,
        starts: Starts,
        requested: RequestedTrials | None = None,
    ) -> Evaluation:
        """Evaluate genomes [1, N, ...], in NumPy."""
        shape, batch = self._known(recipe)
        count = jax.tree.leaves(genomes)[0].shape[1]

        def compile_it() -> jax.stages.Compiled:
            program = batch.lower_evaluate(genomes, starts, requested)
            with self._turn(shape.name("evaluate", count)):
                return compiled(program)

        program = self._evaluators.find((shape, count), compile_it)
        numbers, rows = batch.known
        given = (
            numbers,
            rows.settings,
            starts,
            genomes,
            *([] if requested is None else [requested]),
        )
        evaluation: Evaluation = jax.device_get(program(*given))
        return evaluation

    def _known(self, recipe: Recipe) -> tuple[BatchKey, Batch]:
        """Return the runs of a recipe, and the shape of their program."""
        return self._batches.find(recipe.digest, lambda: self._built(recipe))

    def _built(self, recipe: Recipe) -> tuple[BatchKey, Batch]:
        creature, configs = recipe.read()
        shape = program_key(creature, configs[0])
        spec = self._specs.find(shape, lambda: make_spec(creature, configs[0]))
        batch = build_batch(creature, configs, spec, recipe.sources)
        sources = max(map(len, recipe.sources), default=0)
        return BatchKey(shape, len(configs), sources), batch


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

    planted: arrays [B, N, ...] of the first genomes by name, in place of random ones; N <= P.
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
        begun = self.state or pack(batch.init()).with_first(self.planted or {})
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

    requested: see `Evaluator`.
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
