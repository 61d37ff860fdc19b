"""Runs of a study as rows of a few programs."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from mjxgait.champion import write_champion
from mjxgait.config.traced import traced_structure
from mjxgait.creature import Creature
from mjxgait.distributed.drive import drive
from mjxgait.distributed.jobs import Advanced, AdvanceRows, Job, Recipe
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.experiments.ablation.plan import Plan, Run
from mjxgait.training.checkpoint import Checkpoints, Packed
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import METRICS
from mjxgait.training.logs import Line, append_lines, truncate_metrics
from mjxgait.training.loop import interruptible

if TYPE_CHECKING:
    from jax.tree_util import PyTreeDef

GROUPS, CHAMPIONS = "groups", "champions"
TIMES = ("wall_s", "steps_per_second")
"""Metrics that the log of a study leaves out."""


class News(TypedDict, total=False):
    """Message on a group: `compiling` alone, the number of its runs, or all other keys.

    generation, of: reached, and the last. generations, seconds, steps: of what was just done.
    """

    compiling: int
    generation: int
    of: int
    generations: int
    seconds: float
    steps: int
    note: str


Progress = Callable[[int, int, News], None]
"""Callback with the group, the number of groups and the progress to report."""


def groups(plan: Plan) -> list[list[Run]]:
    """Return the runs that share a program, side by side, in the plan's order."""
    found: dict[PyTreeDef, list[Run]] = {}
    for run in plan.runs:
        found.setdefault(traced_structure(run.config), []).append(run)
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
    scheduler: Scheduler,
    stride: int = 1,
) -> bool:
    """Run or resume all groups; return whether all were completed.

    Args:
      scheduler: runs the jobs; this process alone runs one group after the other.
      stride: generations between two checkpoints of a group.
    """
    parts = groups(plan)
    left = [
        _Group(folder, creature, plan, runs, number, partial(tell, number, len(parts)), stride)
        for number, runs in enumerate(parts)
        if not all(champion_path(folder, plan, run).exists() for run in runs)
    ]
    with interruptible() as interrupted:
        ended = drive(left, scheduler, interrupted.is_set)
        # Ctrl-C in the last generation: what would come next takes minutes too.
        return ended and not interrupted.is_set()


class _Group:
    """Rows of one program, in their own folder below the study's."""

    def __init__(
        self,
        folder: Path,
        creature: Creature,
        plan: Plan,
        runs: list[Run],
        number: int,
        tell: Callable[[News], None],
        stride: int,
    ) -> None:
        self.study, self.creature, self.plan, self.runs = folder, creature, plan, runs
        self.tell, self.jobs = tell, 1
        self.folder, self.stride = folder / GROUPS / str(number), stride
        self.last = max(run.generations for run in runs)
        self.recipe = Recipe.of(creature, [run.config for run in runs])
        self.state: Packed | None = None
        self.checkpoints: Checkpoints | None = None

    @property
    def generation(self) -> int:
        """Generation that the rows have reached; -1 before the first."""
        return -1 if self.state is None else self.state.generation

    @property
    def ended(self) -> bool:
        """Whether all rows have reached their last generation."""
        return self.generation >= self.last

    def job(self, number: int) -> tuple[Recipe, Job[Advanced]]:
        """Return the next job; the first makes the folder."""
        if self.checkpoints is None:
            self._begin()
            self.tell({"compiling": len(self.runs)})
        until = min(self.generation + self.stride, self.last)
        return self.recipe, AdvanceRows(self.state, until)

    def keep(self, done: Sequence[Advanced]) -> None:
        """Write results to disk: the log first, the state last; resuming removes surplus lines."""
        assert self.checkpoints is not None
        (advanced,) = done
        for lines in advanced.lines:
            self._log(lines)
        for row, champion in advanced.champions.items():
            path = champion_path(self.study, self.plan, self.runs[row])
            with disk_errors(self.study):
                write_champion(champion, self.creature, path)
        self.state = advanced.packed
        self.checkpoints.keep(self.state, self.creature.name, self.creature.digest)
        self.tell(self._news(advanced))

    def _news(self, advanced: Advanced) -> News:
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

    def _log(self, lines: Sequence[Line]) -> None:
        """Append one line per run that has not ended.

        Wall time is left out: the rows share it, and it is never the same twice.
        """
        append_lines(
            self.folder / METRICS,
            (
                {"variant": run.variant, "seed": run.seed, **_without(line, TIMES)}
                for run, line in zip(self.runs, lines, strict=True)
                if line["generation"] <= run.generations
            ),
        )


def _without(line: Line, names: Sequence[str]) -> Line:
    return {name: value for name, value in line.items() if name not in names}
