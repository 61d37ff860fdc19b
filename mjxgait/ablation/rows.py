"""Runs a study: its runs are rows of a few compiled programs, one per shape, and share the
lanes.
"""

import dataclasses
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import jax
import numpy as np

from mjxgait.ablation.plan import Plan, Run
from mjxgait.champion import write_champion
from mjxgait.creature import Creature
from mjxgait.runs.checkpoint import Checkpoints
from mjxgait.runs.disk import disk_errors
from mjxgait.runs.experiment import Batch, build_batch
from mjxgait.runs.folder import METRICS, truncate_metrics
from mjxgait.runs.loop import interruptible, metrics_line, versions
from mjxgait.search.state import EvolutionState
from mjxgait.settings.traced import traced

GROUPS, CHAMPIONS = "groups", "champions"

Progress = Callable[[int, int, dict[str, Any]], None]
"""Called with the group, the number of groups and what to tell."""


def groups(plan: Plan) -> list[list[Run]]:
    """The runs that share a program, in the order of the plan."""
    found: dict[Any, list[Run]] = {}
    for run in plan.runs:
        found.setdefault(jax.tree.structure(traced(run.config)), []).append(run)
    return list(found.values())


def champion_path(folder: Path, plan: Plan, run: Run) -> Path:
    """Where the best individual of a run lies once the run has ended."""
    return folder / CHAMPIONS / f"{plan.variants.index(run.variant)}-{run.seed}.json"


def run_study(folder: Path, creature: Creature, plan: Plan, tell: Progress) -> bool:
    """Runs, or goes on with, all groups; returns whether they came to their end."""
    parts = groups(plan)
    with interruptible() as interrupted:
        for number, runs in enumerate(parts):
            if interrupted.is_set():
                return False
            if all(champion_path(folder, plan, run).exists() for run in runs):
                continue
            _Group(folder, creature, plan, runs, number).evolve(
                interrupted.is_set, partial(tell, number, len(parts))
            )
    return not interrupted.is_set()


class _Group:
    """The rows of one program, in a folder of their own below the study's."""

    def __init__(
        self, folder: Path, creature: Creature, plan: Plan, runs: list[Run], number: int
    ) -> None:
        self.study, self.creature, self.plan, self.runs = folder, creature, plan, runs
        self.folder = folder / GROUPS / str(number)
        self.last = max(run.generations for run in runs)
        with disk_errors(folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            (folder / CHAMPIONS).mkdir(exist_ok=True)

    def evolve(self, stopped: Callable[[], bool], tell: Callable[[dict[str, Any]], None]) -> None:
        """Generation after generation, each on disk before the next begins."""
        batch = build_batch(self.creature, [run.config for run in self.runs])
        checkpoints = Checkpoints(self.folder, keep_every=self.last + 1)
        states = self._begin(batch, checkpoints)
        tell({"compiling": len(self.runs), "note": batch.experiments[0].plant_note})
        step = batch.compile()
        states, task = batch.place(states), batch.experiments[0].simulator.task
        try:
            while (generation := int(np.max(states.generation))) < self.last and not stopped():
                began = time.perf_counter()
                states, metrics = step(states)
                metrics = jax.device_get(metrics)
                now = int(np.max(metrics.generation))
                if now < 0:
                    continue
                lines = [
                    metrics_line(jax.tree.map(lambda leaf, i=i: leaf[i], metrics), 1.0, task)
                    for i in range(len(self.runs))
                ]
                self._log(lines)
                self._keep_champions(batch, states, now)
                checkpoints.save(states, self.creature.name, self.creature.digest)
                seconds = time.perf_counter() - began
                tell(
                    {
                        "generation": now,
                        "of": self.last,
                        "seconds": seconds,
                        "steps": int(metrics.sim_steps.sum()),
                        "before": generation,
                    }
                )
        finally:
            checkpoints.close()

    def _begin(self, batch: Batch, checkpoints: Checkpoints) -> EvolutionState:
        if not checkpoints.generations():
            truncate_metrics(self.folder / METRICS, -1)
            return batch.init()
        states = checkpoints.restore(batch.abstract(), self.creature.digest)
        truncate_metrics(self.folder / METRICS, int(np.max(states.generation)))
        return states

    def _log(self, lines: list[dict[str, Any]]) -> None:
        """One line per run that has not come to its own end.

        Wall time is left out: it is not a run's own, and never the same twice.
        """
        with disk_errors(self.folder), (self.folder / METRICS).open("a", encoding="utf-8") as log:
            for run, line in zip(self.runs, lines, strict=True):
                if line["generation"] <= run.generations:
                    kept = {
                        key: value
                        for key, value in line.items()
                        if key not in ("wall_s", "steps_per_second")
                    }
                    log.write(json.dumps({"variant": run.variant, "seed": run.seed, **kept}) + "\n")

    def _keep_champions(self, batch: Batch, states: EvolutionState, now: int) -> None:
        for row, run in enumerate(self.runs):
            if now == run.generations:
                state = jax.tree.map(
                    lambda leaf, i=row: leaf[i], dataclasses.replace(states, key=states.generation)
                )
                champion = batch.experiments[row].champion(state, versions())
                with disk_errors(self.study):
                    write_champion(
                        champion, self.creature, champion_path(self.study, self.plan, run)
                    )
