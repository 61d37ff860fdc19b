"""Measures of each run of a study.

C MuJoCo evaluates all variants alike, whatever fitness they evolved for.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from mjxgait.certification import certify
from mjxgait.certification.acceptance import acceptance_of
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion, by_skill, read_champion
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.experiments.ablation.plan import Plan, Run, Study
from mjxgait.experiments.ablation.rows import GROUPS, champion_path
from mjxgait.plugins.user_code import load_all, loaded
from mjxgait.processes import process_per_core, survivable
from mjxgait.reference.starts import join, nominal_starts, perturbed_starts
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import CREATURE, METRICS, command
from mjxgait.training.logs import Line, append_lines, read_metrics, read_records, write_lines
from mjxgait.training.stored import is_number

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
    lost = next((run for run in plan.runs if (run.variant, run.seed) not in lines), None)
    if lost is not None:
        raise UserError(
            f"{folder}: no log of {lost.variant}, seed {lost.seed}; take its metrics from a copy, or "
            "remove its champion, and the run is made anew"
        )
    if not missing:
        return [known[run.variant, run.seed] for run in plan.runs]
    tell(0, len(missing))
    prepare = partial(load_all, loaded())
    again = command("ablate", "--resume", folder, run=folder)
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

    Speeds are in body lengths per second; the nominal one is 0 after a fall. Of several skills the
    worst value of each counts.
    """
    if skills := by_skill(champion).values():
        each = [walked(one.embodied(creature), one) for one in skills]
        speed, share, nominal = map(min, zip(*each, strict=True))
        return speed, share, nominal
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
