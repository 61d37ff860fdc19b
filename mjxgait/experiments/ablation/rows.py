"""Runs of a study as rows of a few compiled programs, one per shape; rows share the lanes."""

import contextlib
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, cast

import jax

from mjxgait.champion import write_champion
from mjxgait.config.traced import traced
from mjxgait.creature import Creature
from mjxgait.distributed.jobs import Advanced, AdvanceRows, Job
from mjxgait.distributed.recipe import Recipe
from mjxgait.distributed.scheduler import Crew
from mjxgait.experiments.ablation.plan import Plan, Run
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import METRICS, truncate_metrics
from mjxgait.training.loop import interruptible
from mjxgait.training.packed import Packed

GROUPS, CHAMPIONS = "groups", "champions"

Progress = Callable[[int, int, dict[str, Any]], None]
"""Callback with the group, the number of groups and the progress to report."""


def groups(plan: Plan) -> list[list[Run]]:
    """Return the runs that share a program, side by side, in the plan's order."""
    found: dict[Any, list[Run]] = {}
    for run in plan.runs:
        found.setdefault(jax.tree.structure(traced(run.config)), []).append(run)
    most = plan.study.rows or len(plan.runs)
    return [
        runs[first : first + most] for runs in found.values() for first in range(0, len(runs), most)
    ]


def champion_path(folder: Path, plan: Plan, run: Run) -> Path:
    """Return the file of a run's best individual, written at the end of the run."""
    return folder / CHAMPIONS / f"{plan.variants.index(run.variant)}-{run.seed}.json"


def run_study(
    folder: Path,
    creature: Creature,
    plan: Plan,
    tell: Progress,
    crew: Crew,
    stride: int = 1,
) -> bool:
    """Run or resume all groups; return whether all were completed.

    Args:
      crew: scheduler; this process alone runs one group after the other.
      stride: generations between two checkpoints of a group.
    """
    parts = groups(plan)
    left = {
        number: _Group(folder, creature, plan, runs, number, stride)
        for number, runs in enumerate(parts)
        if not all(champion_path(folder, plan, run).exists() for run in runs)
    }
    with interruptible() as interrupted, contextlib.ExitStack() as at_last:
        for number, group in left.items():
            at_last.callback(group.close)
            crew.submit(number, partial(group.work, partial(tell, number, len(parts))))
        while left and (done := crew.next(interrupted.is_set)):
            number, advanced = cast(tuple[int, Advanced], done)
            group = left[number]
            group.keep(advanced)
            tell(number, len(parts), group.news(advanced))
            if group.generation < group.last:
                crew.submit(number, group.work, first=True)
            else:
                left.pop(number).close()
    return not left


class _Group:
    """Rows of one program, in their own folder below the study's."""

    def __init__(
        self,
        folder: Path,
        creature: Creature,
        plan: Plan,
        runs: list[Run],
        number: int,
        stride: int,
    ) -> None:
        self.study, self.creature, self.plan, self.runs = folder, creature, plan, runs
        self.folder, self.stride = folder / GROUPS / str(number), stride
        self.last = max(run.generations for run in runs)
        self.recipe = Recipe.of(creature, [run.config for run in runs])
        self.state: Packed | None = None
        self.checkpoints: Checkpoints | None = None

    @property
    def generation(self) -> int:
        """Generation that the rows have reached; -1 before the first."""
        return -1 if self.state is None else self.state.generation

    def work(self, tell: Callable[[dict[str, Any]], None] | None = None) -> tuple[Recipe, Job]:
        """Return the next job. tell: only on the first call, which makes the folder."""
        if tell:
            self._begin()
            tell({"compiling": len(self.runs)})
        until = min(self.generation + self.stride, self.last)
        return self.recipe, AdvanceRows(self.state, until)

    def keep(self, advanced: Advanced) -> None:
        """Write results to disk: the log first, the state last; resuming removes surplus lines."""
        assert self.checkpoints is not None
        for lines in advanced.lines:
            self._log(lines)
        for row, champion in advanced.champions.items():
            path = champion_path(self.study, self.plan, self.runs[row])
            with disk_errors(self.study):
                write_champion(champion, self.creature, path)
        self.state = advanced.packed
        self.checkpoints.keep(self.state, self.creature.name, self.creature.digest)

    def news(self, advanced: Advanced) -> dict[str, Any]:
        """Return the progress to report."""
        return {
            "generation": self.generation,
            "of": self.last,
            "generations": len(advanced.lines),
            "seconds": advanced.seconds,
            "steps": advanced.steps,
            "note": advanced.note,
        }

    def close(self) -> None:
        """Wait until everything is on disk."""
        if self.checkpoints is not None:
            self.checkpoints.close()
            self.checkpoints = None

    def _begin(self) -> None:
        with disk_errors(self.study):
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.study / CHAMPIONS).mkdir(exist_ok=True)
        self.checkpoints = Checkpoints(self.folder, keep_every=self.last + 1)
        if self.checkpoints.generations():
            self.state = self.checkpoints.read(self.creature.digest)
        truncate_metrics(self.folder / METRICS, self.generation)

    def _log(self, lines: list[dict[str, Any]]) -> None:
        """Append one line per run that has not ended.

        Wall time is left out: the rows share it, and it is never the same twice.
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
