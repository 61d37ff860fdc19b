"""Run of several populations that exchange their best, each advanced by any worker.

All exchange at the same generation, so the result depends only on the settings and the seed. Each
island's state is on this machine's disk before the island continues: the machine that computed it
may be lost.
"""

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from mjxgait.config.evolution import IslandsConfig
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.distributed.drive import drive
from mjxgait.distributed.jobs import Advanced, AdvanceIsland, Lines, Recipe
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.evolution.state import EvolutionState, stop_reason
from mjxgait.training.advance import versions
from mjxgait.training.checkpoint import Checkpoints, Packed
from mjxgait.training.disk import disk_errors
from mjxgait.training.examination import Examined, Examiner, why_ended
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.folder import EXAMS, ISLANDS, METRICS, MIGRATIONS
from mjxgait.training.lock import locked_run
from mjxgait.training.logs import PARENTS, Line, append_lines, truncate_metrics
from mjxgait.training.loop import conclude, interruptible, keep_best, report
from mjxgait.training.prescreen import prescreen_of
from mjxgait.training.screen import Screen

OF_EACH = ("terms", "outcome", "fitness", "born", "origin", "rounds")
"""Arrays [P, ...] of a state, besides those of the genomes."""
SUMS = ("failures", "episodes", "evaluations", "sim_steps", "computed_steps", "unique")
MEANS = ("mean", "median", "lower_quartile", "upper_quartile", "spread")
"""Metrics summed or averaged over the islands; the other metrics are those of the best one."""


def exchanged(states: Sequence[Packed], config: IslandsConfig) -> list[Packed]:
    """Return the states after each island's best have replaced the worst of others.

    All states are of the same generation. Individuals evaluated on easier trials than an island's
    do not migrate to it.
    """
    found = [_individuals(state.arrays) for state in states]

    def come(island: int) -> list[dict[str, np.ndarray]]:
        least = _level(states[island])
        sources = [i for i in config.sources(island) if _level(states[i]) >= least]
        return [_first(found[i], config.migrants) for i in sources]

    return [_taken_in(state, come(island)) for island, state in enumerate(states)]


def gathered(states: Sequence[Packed]) -> Packed:
    """Return the best of all islands as one population of the same size.

    All else is the best island's. Of islands whose trials differ in difficulty, only those with the
    hardest count.
    """
    hardest = max(map(_level, states))
    states = [state for state in states if _level(state) == hardest]
    leader = int(np.nanargmax([_comparable(state.arrays["fitness"])[0] for state in states]))
    size = len(states[leader].arrays["fitness"])
    found = [_individuals(state.arrays) for state in states]
    return states[leader].with_arrays(_sorted(_joined(found), size))


def together(lines: Sequence[Line], seconds: float) -> Line:
    """Return one metrics line for all islands; `island` is the index of the best one.

    seconds: of all islands for a generation, compilation included. Islands that took turns took
    the sum of their own times, which exclude it.
    """
    bests = [-np.inf if line["best"] is None else line["best"] for line in lines]
    leader = int(np.argmax(bests))
    line = dict(lines[leader]) | {"island": leader}
    # A migrant has no parents on this island.
    line = {name: value for name, value in line.items() if name not in PARENTS}
    line |= {name: sum(each[name] for each in lines) for name in SUMS}
    for name in MEANS:
        known = [each[name] for each in lines if each[name] is not None]
        line[name] = float(np.mean(known)) if known else None
    worst = [each["worst"] for each in lines if each["worst"] is not None]
    line["worst"] = min(worst, default=None)
    line["forced"] = any(each["forced"] for each in lines)
    line["wall_s"] = round(min(seconds, sum(each["wall_s"] for each in lines)), 4)
    line["steps_per_second"] = round(line["sim_steps"] / max(line["wall_s"], 1e-9))
    return line


def _taken_in(state: Packed, migrants: Sequence[Mapping[str, np.ndarray]]) -> Packed:
    """Replace the worst of a population by migrants, at most half of it; sort best first."""
    if not migrants:
        return state
    size = len(state.arrays["fitness"])
    come = _sorted(_joined(migrants), size // 2)
    stay = _first(_individuals(state.arrays), size - len(come["fitness"]))
    return state.with_arrays(_sorted(_joined([stay, come]), size))


def _level(state: Packed) -> int:
    """Number of times that the trials have become harder."""
    return int(state.arrays.get("level", 0))


def _individuals(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {
        name: array
        for name, array in arrays.items()
        if name in OF_EACH or name.partition(".")[0] == "genomes"
    }


def _first(arrays: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    return {name: array[:count] for name, array in arrays.items()}


def _joined(parts: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _sorted(arrays: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """Return the best `count`, best first; ties keep their order."""
    order = np.argsort(-_comparable(arrays["fitness"]), kind="stable")[:count]
    return {name: array[order] for name, array in arrays.items()}


def _comparable(fitness: np.ndarray) -> np.ndarray:
    return np.where(np.isnan(fitness), -np.inf, fitness)


def train(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: Screen,
    scheduler: Scheduler,
    resume: bool,
    begin: Callable[[], object] = lambda: None,
) -> bool:
    """Start or resume the islands in a run folder; return whether they reached their end.

    begin: makes the folder of new islands; called after the last check.
    """
    experiment = build_experiment(creature, config)
    with locked_run(folder, resume, begin):
        return _train(folder, experiment, screen, scheduler, resume)


def _train(
    folder: Path, experiment: Experiment, screen: Screen, scheduler: Scheduler, resume: bool
) -> bool:
    if experiment.plant_note:
        screen.say(experiment.plant_note)
    exams, prescreen = Exams(folder / EXAMS), prescreen_of(experiment)
    examiner = Examiner(experiment, versions(), screen.say, exams, prescreen)
    islands, began = _Islands(folder, examiner, screen, resume), time.perf_counter()
    screen.say(f"{islands.settings.count} islands, from generation {islands.generation + 1}")
    try:
        with interruptible() as interrupted:
            drive([islands], scheduler, interrupted.is_set)
    finally:
        screen.close()
    if islands.ended:
        best = islands.examined or examiner.best(islands.together())
        conclude(folder, experiment.creature, screen, best)
    report(folder, screen, islands.reason, time.perf_counter() - began)
    return islands.ended


class _Islands:
    """States of the islands, on disk and in memory.

    Attributes:
      reason: why the run is over; None before. examined: what ended it, if an examination did.
    """

    reason: str | None = None
    examined: Examined | None = None

    def __init__(self, folder: Path, examiner: Examiner, screen: Screen, resume: bool) -> None:
        self.folder, self.examiner, self.screen = folder, examiner, screen
        self.creature = creature = examiner.experiment.creature
        config = examiner.experiment.config
        # A stuck island does not stop the run: others may still improve.
        evolution = config.evolution.patient()
        self.config = dataclasses.replace(config, evolution=evolution)
        self.settings, self.recipe = evolution.islands, Recipe.of(creature, [self.config])
        self.places = [folder / ISLANDS / str(i) for i in range(self.settings.count)]
        with disk_errors(folder):
            for place in self.places:
                place.mkdir(parents=True, exist_ok=True)
        self.stores = [Checkpoints(place, config.keep_every) for place in self.places]
        self.store = Checkpoints(folder, config.keep_every)
        self.states: list[Packed | None] = [None] * self.settings.count
        self.generation = self._common() if resume else -1
        self._next: list[Packed | None] | None = None
        """States to continue from; None before a job needs them."""
        self._began = 0.0
        self._return_to(self.generation)

    @property
    def jobs(self) -> int:
        """Number of jobs that lead to the next exchange: one for each island."""
        return self.settings.count

    @property
    def ended(self) -> bool:
        """Whether the run is over."""
        return self.reason is not None

    def job(self, number: int) -> tuple[Recipe, AdvanceIsland]:
        """Return the job of one island, to the next exchange or to the end."""
        if self._next is None:
            self._next, self._began = self._sent(), time.perf_counter()
        stride = self.settings.every or self.config.checkpoint_every
        until = (max(self.generation, 0) // stride + 1) * stride
        until = min(until, self.config.evolution.generations)
        return self.recipe, AdvanceIsland(self._next[number], until, number)

    def keep(self, done: Sequence[Advanced]) -> None:
        """Write all states to disk; show and examine the best."""
        self._next, seconds = None, time.perf_counter() - self._began
        for line in self._written(done, seconds):
            self.screen.generation(line, self.config)
        self._examine()

    def _examine(self) -> None:
        """Write the best as champion; set `reason` if the run is over."""
        experiment, state = self.examiner.experiment, self.together()
        keep_best(self.folder, experiment, state)
        self.reason = stop_reason(state, self.config.evolution)
        if self.reason is None and (examined := self.examiner.early(state)):
            self.examined = examined
            self.reason = why_ended(self.generation, examined.certificate.margin)

    def _written(self, found: Sequence[Advanced], seconds: float) -> Lines:
        """Write all states to disk; return the metrics lines of all islands together.

        seconds: that the islands took.
        """
        # An island that has reached the target has fewer generations than the others.
        rows = list(zip(*([lines[0] for lines in each.lines] for each in found), strict=False))
        lines = [together(row, seconds / len(rows)) for row in rows]
        for place, advanced in zip(self.places, found, strict=True):
            append_lines(place / METRICS, [own[0] for own in advanced.lines])
        append_lines(self.folder / METRICS, lines)
        self.states = [advanced.packed for advanced in found]
        self.generation = min(advanced.packed.generation for advanced in found)
        for store, advanced in zip(self.stores, found, strict=True):
            store.keep(advanced.packed, self.creature.name, self.creature.digest)
        self.store.keep(
            gathered([advanced.packed for advanced in found]),
            self.creature.name,
            self.creature.digest,
        )
        return lines

    def together(self) -> EvolutionState:
        """Return the best of all islands as one state."""
        known = [state for state in self.states if state is not None]
        return gathered(known).state(self.examiner.experiment.abstract(), str(self.folder))

    def close(self) -> None:
        """Wait until everything is on disk."""
        for store in (*self.stores, self.store):
            store.close()

    def _sent(self) -> list[Packed | None]:
        """Return the states to continue from, after an exchange if one is due."""
        known = [state for state in self.states if state is not None]
        every = self.settings.every
        if not known or not every or self.generation % every or len(known) == 1:
            return self.states
        append_lines(self.folder / MIGRATIONS, self._migration_lines(known))
        return list(exchanged(known, self.settings))

    def _migration_lines(self, states: list[Packed]) -> Lines:
        best = [state.arrays["fitness"][: self.settings.migrants].tolist() for state in states]
        return [
            {"generation": self.generation, "from": source, "to": island, "fitness": best[source]}
            for island in range(len(states))
            for source in self.settings.sources(island)
        ]

    def _common(self) -> int:
        """Return the latest generation that all islands have a checkpoint of, -1 if none."""
        return max(
            set.intersection(*(set(store.generations()) for store in self.stores)), default=-1
        )

    def _return_to(self, generation: int) -> None:
        for store in (*self.stores, self.store):
            store.drop_after(generation)
        if generation >= 0:
            self.states = [store.read(self.creature.digest, generation) for store in self.stores]
        with disk_errors(self.folder):
            for place in (*self.places, self.folder):
                truncate_metrics(place / METRICS, generation)
            # The exchange that follows this generation is repeated.
            truncate_metrics(self.folder / MIGRATIONS, generation - 1)
