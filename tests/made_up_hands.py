"""Backend without evolution, so that no program is compiled."""

from collections.abc import Callable
from typing import Any

import numpy as np
from rendering.made_up import metrics_line

from mjxgait.distributed.jobs import Advanced, AdvanceRows, Programs, Recipe
from mjxgait.distributed.scheduler import Report, Scheduler, Worker
from mjxgait.experiments.repertoire.grid import POSES
from mjxgait.training.checkpoint import pack

PROGRAMS = Programs()


class Pretend:
    """Backend without evolution: each job bends all poses by 0.01 rad."""

    def __init__(self) -> None:
        self._coming, self._work = [Worker(0, "here")], None

    def arrivals(self) -> list[Worker]:
        coming, self._coming = self._coming, []
        return coming

    def start(self, worker: Worker, recipe: Recipe, job: Any) -> None:
        self._work = worker, recipe, job

    def wait(self, seconds: float) -> list[Report]:
        if self._work is None:
            return []
        (worker, recipe, job), self._work = self._work, None
        return [Report(worker, pretended(recipe, job))]


def pretended(recipe: Recipe, job: AdvanceRows) -> Advanced:
    batch = PROGRAMS.batch(recipe)
    before = job.state or pack(batch.init()).with_first(job.planted or {})
    rows = len(batch.experiments)
    new = {
        "generation": np.full(rows, job.until, np.int32),
        "fitness": np.ones_like(before.arrays["fitness"]),
        POSES: before.arrays[POSES] + np.float32(0.01),
    }
    begun = -1 if job.state is None else job.state.generation
    lines = [[metrics_line(g)] * rows for g in range(begun + 1, job.until + 1)]
    return Advanced(before.with_arrays(new), lines, "", 1.0, 1)


class Interrupted(Scheduler):
    """Scheduler that stops after `left` jobs."""

    left = 3

    def next(self, stopped: Callable[[], bool]) -> Any:
        self.left -= 1
        return super().next(lambda: self.left < 0)
