"""Runs of a study as rows of a few programs, and the measures taken of each.

C MuJoCo evaluates all variants alike, whatever fitness they evolved for.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from mjxgait.certification import certify
from mjxgait.certification.acceptance import acceptance_of
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion, read_champion, write_champion
from mjxgait.config.traced import traced_structure
from mjxgait.creature import Creature, load_creature
from mjxgait.distributed.drive import drive
from mjxgait.distributed.jobs import Advanced, AdvanceRows, Job, Recipe
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.experiments.ablation.plan import Plan, Run, Study
from mjxgait.plugins.user_code import load_all, loaded
from mjxgait.processes import process_per_core, survivable
from mjxgait.reference.starts import join, nominal_starts, perturbed_starts
from mjxgait.training.checkpoint import Checkpoints, Packed
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import (
    CREATURE,
    METRICS,
    Line,
    append_lines,
    read_metrics,
    read_records,
    truncate_metrics,
    write_lines,
)
from mjxgait.training.loop import interruptible
from mjxgait.training.stored import is_number

if TYPE_CHECKING:
    from jax.tree_util import PyTreeDef

GROUPS, CHAMPIONS = "groups", "champions"
TIMES = ("wall_s", "steps_per_second")
"""Metrics that the log of a study leaves out."""


class News(TypedDict, total=False):
    """Progress of a group: `compiling` runs side by side, or all the rest.

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


MEASURED = "measured.jsonl"
SECONDS, STARTS, SEED = 22.0, 16, 1000
"""Duration (s), starts and random seed of the walk that evaluates every champion.

The starts are perturbed as in the certificate, and unseen in evolution.
"""


Ways = dict[str, tuple[float, float]]
"""A champion's `walk` and `up` on each ground."""
Measured = tuple[Ways, bool | None]
"""A champion's `Ways` and the `certified` of its `Result`."""


@dataclasses.dataclass(frozen=True)
class Result:
    """Result of a run.

    walk: body lengths per second covered before the fall or the end, mean over unseen perturbed
    starts. up: share of them that stay up and meet the task's other demands of criterion 4.
    certified: whether the champion passes the whole certificate; None if not examined. fitness:
    best at the end. area: mean of the best over the generations. generations: until the best
    reached the study's threshold; if never, one more than the run had.
    steps: creature-steps simulated. finite: whether the best fitness at the end is finite.
    elsewhere: `walk` and `up` on the study's further grounds.
    """

    variant: str
    seed: int
    walk: float
    up: float
    certified: bool | None
    fitness: float
    area: float
    generations: int
    steps: int
    finite: bool
    elsewhere: Ways = dataclasses.field(default_factory=dict)

    def value(self, measure: str) -> float:
        """Return a measure as a number."""
        return float(getattr(self, measure) or 0.0)

    def on(self, ground: str) -> "Result":
        """Return the result with `walk` and `up` of one of the further grounds."""
        walk, up = self.elsewhere[ground]
        return dataclasses.replace(self, walk=walk, up=up, certified=None)


def read_logs(folder: Path) -> list[Line]:
    """Return every generation of every run that a study has logged so far."""
    found = (folder / GROUPS).glob(f"*/{METRICS}")
    known = [file for file in found if is_number(file.parent.name)]
    files = sorted(known, key=lambda file: int(file.parent.name))
    return [line for file in files for line in read_metrics(file)]


def measure(folder: Path, plan: Plan, tell: Callable[[int, int], None]) -> list[Result]:
    """Return the result of every run in the plan's order, measured by one process per core.

    Results measured before are reused.

    Raises:
      UserError: a process was killed from outside, or the folder cannot be written.
    """
    measured = _measured(folder)
    if measured:  # drops a last line that was cut off, or the next would be appended to it
        with disk_errors(folder):
            write_lines(folder / MEASURED, measured)
    known = {(line["variant"], line["seed"]): Result(**line) for line in measured}
    lines: dict[tuple[str, int], list[Line]] = {}
    for line in read_logs(folder):
        lines.setdefault((line["variant"], line["seed"]), []).append(line)
    missing = [run for run in plan.runs if (run.variant, run.seed) not in known]
    if missing:
        tell(0, len(missing))
    prepare = partial(load_all, loaded())
    again = f"mjxgait ablate --resume {folder}"
    with survivable(folder, again), process_per_core(len(missing), prepare) as pool:
        found = pool.map(
            partial(_evaluate, folder / CREATURE, plan.study.grounds, plan.study.certify),
            [champion_path(folder, plan, run) for run in missing],
            [_has_finite_best(lines[run.variant, run.seed]) for run in missing],
        )
        for number, (run, outcome) in enumerate(zip(missing, found, strict=True), 1):
            result = _result(plan.study, run, lines[run.variant, run.seed], outcome)
            known[result.variant, result.seed] = result
            append_lines(folder / MEASURED, [dataclasses.asdict(result)])
            tell(number, len(missing))
    return [known[run.variant, run.seed] for run in plan.runs]


def _measured(folder: Path) -> list[Line]:
    return read_records(folder / MEASURED, Result)


def _result(study: Study, run: Run, lines: Sequence[Line], measured: Measured) -> Result:
    ways, certified = measured
    walk, up = ways[study.grounds[0]]
    best = [-math.inf if line["best"] is None else line["best"] for line in lines]
    finite, threshold = _has_finite_best(lines), study.threshold
    reached = [i for i, value in enumerate(best) if threshold is not None and value >= threshold]
    return Result(
        variant=run.variant,
        seed=run.seed,
        walk=walk,
        up=up,
        certified=certified,
        fitness=best[-1] if finite else -1e9,
        area=float(np.mean([value for value in best if math.isfinite(value)])) if finite else -1e9,
        generations=reached[0] if reached else run.generations + 1,
        steps=sum(line["sim_steps"] for line in lines),
        finite=finite,
        elsewhere={ground: ways[ground] for ground in study.grounds[1:]},
    )


def _has_finite_best(lines: Sequence[Line]) -> bool:
    """Return whether the best fitness at the end is finite."""
    return lines[-1]["best"] is not None


def _evaluate(
    creature_folder: Path, grounds: Sequence[str], examine: bool, path: Path, finite: bool
) -> Measured:
    """Evaluate the champion at `path` on each ground; if `examine`, also certify it on the first.

    Runs in its own process. The arguments are small: the pool of Python 3.11 hangs if a process is
    killed while it receives more than a pipe holds.
    """
    creature = _creature(creature_folder)
    champion = read_champion(path, creature)
    body = champion.embodied(creature)
    walks = {g: walked(body.on(g), champion) if finite else (0.0, 0.0, 0.0) for g in grounds}
    # A walk that falls or lags this far behind the certificate's speed cannot pass: skip the long
    # examination.
    worth = champion.task != "walk" or walks[grounds[0]][2] > 0.4
    ways = {ground: (walk, up) for ground, (walk, up, _) in walks.items()}
    if not examine:
        return ways, None
    return ways, worth and certify(body.on(grounds[0]), champion, threads=1).passed


@functools.cache
def _creature(folder: Path) -> Creature:
    """Return the creature, loaded once per process."""
    return load_creature(folder)


def walked(creature: Creature, champion: Champion) -> tuple[float, float, float]:
    """Return mean speed and success share over the unseen starts, and the nominal start's speed.

    Speeds are in body lengths per second; the nominal one is 0 after a fall.
    """
    config, rng = CertificateConfig(), np.random.default_rng(SEED)
    acceptance = acceptance_of(champion.task, champion.wish)
    unseen = acceptance.aimed(perturbed_starts(creature, STARTS, rng), config, rng)
    starts = acceptance.aimed(join(nominal_starts(creature, 1), unseen), config)
    fall = acceptance.fall(config)
    outcome = simulate(creature, champion, starts, SECONDS, fall=fall, threads=1)
    speed = outcome.travel[:, 0] / creature.frame.body_length / SECONDS
    return (
        float(speed[1:].mean()),
        float(acceptance.succeeded(outcome, starts, config)[1:].mean()),
        float(speed[0] * outcome.stayed_up[0]),
    )
