"""Run of several populations that exchange their best, each advanced by any worker.

All exchange at the same generation, so the result depends only on the settings and the seed. Each
island's state is on this machine's disk before the island continues: the machine that computed it
may be lost.
"""

import dataclasses
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.champion import write_champion
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.distributed.jobs import Advanced, AdvanceIsland, Lines
from mjxgait.distributed.migration import exchanged, gathered, together
from mjxgait.distributed.recipe import Recipe
from mjxgait.distributed.scheduler import Crew
from mjxgait.evolution.state import stop_reason
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.disk import disk_errors
from mjxgait.training.examination import Examined, Examiner, why_ended
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.folder import (
    CHAMPION,
    EXAMS,
    ISLANDS,
    METRICS,
    MIGRATIONS,
    truncate_metrics,
)
from mjxgait.training.loop import (
    conclude,
    interruptible,
    report,
    versions,
)
from mjxgait.training.packed import Packed
from mjxgait.training.prescreen import tryout_of
from mjxgait.training.screen import Screen


def train(
    folder: Path,
    creature: Creature,
    config: Config,
    screen: Screen,
    crew: Crew,
    resume: bool,
    begin: Callable[[], object] = lambda: None,
) -> bool:
    """Start or resume the islands in a run folder; return whether they reached their end.

    begin: makes the folder of new islands; called after the last check.
    """
    experiment = build_experiment(creature, config)
    begin()
    if experiment.plant_note:
        screen.say(experiment.plant_note)
    islands = _Islands(folder, creature, config, resume)
    examiner = Examiner(
        experiment, versions(), screen.say, Exams(folder / EXAMS), tryout_of(experiment)
    )
    began, reason, examined = time.perf_counter(), None, None
    screen.say(
        f"{config.evolution.islands.count} islands, from generation {islands.generation + 1}"
    )
    try:
        with interruptible() as interrupted:
            while reason is None:
                start = time.perf_counter()
                found = islands.advance(crew, interrupted.is_set)
                if not found:
                    break
                for line in islands.keep(found, time.perf_counter() - start):
                    screen.generation(line, islands.config)
                reason, examined = _over(islands, examiner)
    finally:
        screen.close()
        islands.close()
    if reason is not None:
        best = examined or examiner.best(islands.together(experiment))
        conclude(folder, creature, screen, best)
    report(folder, screen, reason, time.perf_counter() - began)
    return reason is not None


def _over(islands: "_Islands", examiner: Examiner) -> tuple[str | None, Examined | None]:
    """Write the best as champion; return why the run is over, and what ended it, or None."""
    experiment = examiner.experiment
    state = islands.together(experiment)
    if np.isfinite(state.fitness[0]):
        with disk_errors(islands.folder):
            champion = experiment.champion(state, versions())
            write_champion(champion, experiment.creature, islands.folder / CHAMPION)
    if reason := stop_reason(state, islands.config.evolution):
        return reason, None
    examined = examiner.early(state)
    if examined is None:
        return None, None
    return why_ended(islands.generation, examined.certificate.margin), examined


class _Islands:
    """States of the islands, on disk and in memory."""

    def __init__(self, folder: Path, creature: Creature, config: Config, resume: bool) -> None:
        self.folder, self.creature = folder, creature
        # A stuck island does not stop the run: others may still improve.
        forced = dataclasses.replace(config.evolution.forced, patience=0)
        evolution = dataclasses.replace(config.evolution, forced=forced)
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
        self._return_to(self.generation)

    def advance(self, crew: Crew, stopped: Callable[[], bool]) -> list[Advanced] | None:
        """Advance all islands to the next exchange or to the end; None when stopped."""
        stride = self.settings.every or self.config.checkpoint_every
        until = (max(self.generation, 0) // stride + 1) * stride
        until = min(until, self.config.evolution.generations)
        sent = enumerate(self._sent())
        work = ((self.recipe, AdvanceIsland(state, until, i)) for i, state in sent)
        return crew.all(work, stopped)

    def keep(self, found: list[Advanced], seconds: float) -> list[dict[str, Any]]:
        """Write all states to disk; return the metrics lines of all islands together.

        seconds: that the islands took.
        """
        # An island that has reached the target has fewer generations than the others.
        rows = list(zip(*([lines[0] for lines in each.lines] for each in found), strict=False))
        lines = [together(row, seconds / len(rows)) for row in rows]
        for place, advanced in zip(self.places, found, strict=True):
            _append(place / METRICS, [own[0] for own in advanced.lines])
        _append(self.folder / METRICS, lines)
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

    def together(self, experiment: Experiment) -> Any:
        """Return the best of all islands as one state."""
        known = [state for state in self.states if state is not None]
        return gathered(known).state(experiment.abstract(), str(self.folder))

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
        _append(self.folder / MIGRATIONS, self._told(known))
        return list(exchanged(known, self.settings))

    def _told(self, states: list[Packed]) -> Lines:
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


def _append(path: Path, lines: Lines) -> None:
    with disk_errors(path.parent), path.open("a", encoding="utf-8") as log:
        log.writelines(json.dumps(line) + "\n" for line in lines)
