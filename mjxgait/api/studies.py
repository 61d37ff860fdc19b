"""A study: variants of the settings compared over seeds, with error bars."""

import dataclasses
import math
import shlex
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from mjxgait.api.progress import Progress, pace
from mjxgait.api.requests import check_resumed
from mjxgait.api.run import Place
from mjxgait.champion import Champion, read_champion
from mjxgait.config.layers import find_creature
from mjxgait.config.schema import Physics
from mjxgait.config.tables import (
    build,
    check_whole,
    dump_toml,
    read_toml,
)
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.scale import at_step
from mjxgait.errors import UserError
from mjxgait.files import path_of, write_text, writing
from mjxgait.output import Output, duration
from mjxgait.training.folder import CREATURE, check_free, command, write_creature
from mjxgait.training.lock import locked

if TYPE_CHECKING:
    from mjxgait.experiments.ablation.plan import Plan, Study
    from mjxgait.experiments.ablation.plan import Run as PlannedRun
    from mjxgait.experiments.ablation.rows import News

STUDY = "study.toml"
OVER = ("env", "seeds", "first_seed", "generations", "config", "rows", "physics")
"""Options that override the keys of the same name in the study."""
ROWS, STRIDE = 4, 5
"""Runs and generations of a job on a cluster."""
EXPECTED_SPEED = 0.8e6
"""Creature-steps per second on two cores; only for the estimate."""


@dataclasses.dataclass(frozen=True)
class AblateRequest:
    """Run a study, variants times seeds side by side, with a report (docs/research/ablations.md).

    Writes report.md, report.html, results.csv and generations.parquet into the study folder.

    Attributes:
      study: File of a study, or the name of a shipped one; not needed with --resume.
      out: Folder for the study; by default one under runs/.
      env: Creature, instead of the study's.
      seeds: Number of seeds, instead of the study's.
      first_seed: First seed, instead of the study's.
      generations: Number of generations, instead of the study's; variants with their own number
        keep their share of evaluations.
      config: Base config, instead of the study's: a TOML file, or the name of a shipped one.
      rows: Runs side by side in one program; by default all, on a cluster 4.
      physics: mjx simulates all runs with MJX itself instead of this program's faster step.
      cluster: Evolve on a Ray cluster: HOST:PORT, or auto for the cluster that this machine belongs
        to (docs/guide/cluster.md).
      resume: Folder of a study to continue unchanged.
      hours: Refuse a study that may take longer.
    """

    study: Path | None = None
    out: Path | None = None
    env: str | None = None
    seeds: int | None = None
    first_seed: int | None = None
    generations: int | None = None
    config: str | None = None
    rows: int | None = None
    physics: Physics | None = None
    cluster: str | None = None
    resume: Path | None = None
    hours: float = 12.0


def ablate(
    study: Place,
    *,
    out: Place | None = None,
    env: str | None = None,
    seeds: int | None = None,
    first_seed: int | None = None,
    generations: int | None = None,
    config: str | None = None,
    rows: int | None = None,
    hours: float = 12.0,
    quiet: bool = False,
) -> Path:
    """Run a study, variants times seeds side by side; return its report (docs/guide/studies.md).

    Does the same as `mjxgait ablate`. Beside report.md lie report.html, results.csv and
    generations.parquet.

    Args:
      study: file of a study, or the name of a shipped one.
      out: the folder, which must be empty or new; by default runs/ablate-STUDY.
      env: instead of the study's own creature.
      seeds: number of seeds, instead of the study's own.
      first_seed: instead of the study's own.
      generations: instead of the study's own.
      config: instead of the study's own.
      rows: runs side by side in one program; by default all.
      hours: refuses a study that may take longer.
      quiet: prints nothing.

    Raises:
      UserError: an invalid argument, explained in one sentence.
    """
    request = AblateRequest(
        study=path_of(study),
        out=None if out is None else path_of(out),
        env=env,
        seeds=seeds,
        first_seed=first_seed,
        generations=generations,
        config=config,
        rows=rows,
        hours=hours,
    )
    output = Output(Console(quiet=True) if quiet else None)
    planned = prepared(request)
    output.say(planned.words)
    report = evolve_study(planned, request, output)
    if report is None:
        raise KeyboardInterrupt
    return report


@dataclasses.dataclass(frozen=True, eq=False)
class Prepared:
    """A study before anything is written.

    parts: runs that share a program. words: number of runs, and the time that they take at most.
    """

    folder: Path
    study: "Study"
    creature: Creature
    plan: "Plan"
    parts: "Sequence[Sequence[PlannedRun]]"
    words: str


def prepared(options: AblateRequest) -> Prepared:
    """Check the options and return the planned study. Writes nothing.

    Raises:
      UserError: invalid options, or the study may take longer than allowed.
    """
    from mjxgait.experiments.ablation.plan import check_variants, make_plan

    if not options.hours > 0:
        raise UserError(f"--hours {options.hours:g}: must be above zero")
    name = options.study.stem if options.study else ""
    folder = options.resume or options.out or Path("runs") / f"ablate-{name}"
    if options.resume:
        kept = "a resumed study keeps its runs and their settings"
        check_resumed(options, options.resume, ("hours", "cluster"), kept)
    study, creature = _open(folder) if options.resume else _read(options)
    where = str(options.study or folder / STUDY)
    plan = make_plan(study, creature, where)
    creature = at_step(creature, plan.runs[0].config.rollout.step)
    if not options.resume:
        check_variants(plan, creature, where)
    # JAX takes a second to import, so the study is checked first.
    from mjxgait.experiments.ablation.rows import groups
    from mjxgait.training.stages import prepare_devices

    prepare_devices()
    parts, steps = groups(plan), plan.upper_bound(creature)
    hours = _hours(steps, len(parts))
    words = (
        f"{len(plan.variants)} variants × {study.seeds} seeds = {len(plan.runs)} runs in "
        f"{len(parts)} program{'s' if len(parts) > 1 else ''}; at most "
        f"{steps / 1e6:.0f} M creature-steps, about {duration(3600 * hours)} at most on two cores"
    )
    # A resumed study was allowed when it began.
    if hours > options.hours and not options.resume:
        raise UserError(
            f"this study may take {hours:.0f} hours; take fewer --seeds or --generations, or allow "
            f"it with --hours {math.ceil(hours)}"
        )
    return Prepared(folder, study, creature, plan, parts, words)


def evolve_study(planned: Prepared, options: AblateRequest, output: Output) -> Path | None:
    """Run or continue a study and print its report; return that file, None if interrupted.

    Raises:
      UserError: the body is not supported, or the folder cannot be written.
    """
    from mjxgait.experiments.ablation.measures import measure, read_logs
    from mjxgait.experiments.ablation.report import write_report
    from mjxgait.training.spec import check_spec

    folder, creature, plan = planned.folder, planned.creature, planned.plan
    screen, begin = _Progress(output), None
    if not options.resume:
        check_free(folder)
        for runs in planned.parts:
            check_spec(creature, runs[0].config)
        begin = partial(_create, folder, planned.study, creature)
    if not _run(folder, creature, plan, screen, options.cluster, begin):
        again = command("ablate", "--resume", folder, run=folder)
        output.console.print(f"interrupted; go on with: {again}")
        return None
    results = measure(folder, plan, screen.examined)
    typed = shlex.join(["mjxgait", "ablate", *_repeatable(options)])
    report = write_report(folder, plan, results, read_logs(folder), typed)
    output.console.print(report.read_text(encoding="utf-8"))
    output.console.print(f"report        {report}, {report.with_suffix('.html')}")
    return report


def champions_of_study(folder: Path) -> list[tuple[str, Creature, Champion]]:
    """Return the champions that a study keeps so far: a name, the creature given, and the genome.

    Raises:
      UserError: not the folder of a study, or a damaged file.
    """
    from mjxgait.experiments.ablation.plan import make_plan
    from mjxgait.experiments.ablation.rows import champion_path

    study, creature = _open(folder)
    plan = make_plan(study, creature, str(folder / STUDY))
    files = {f"{run.variant} seed{run.seed}": champion_path(folder, plan, run) for run in plan.runs}
    return [
        (name, creature, read_champion(file, creature))
        for name, file in files.items()
        if file.is_file()
    ]


def _read(options: AblateRequest) -> tuple["Study", Creature]:
    """Return a new study with the options over it, and its creature."""
    from mjxgait.experiments.ablation.plan import read_study

    if options.study is None:
        raise UserError(
            "name the file of a study, such as: mjxgait ablate forced_evolution --out runs/forced"
        )
    study = read_study(options.study, {name: getattr(options, name) for name in OVER})
    if options.cluster and not study.rows:
        study = dataclasses.replace(study, rows=ROWS)
    return study, load_creature(find_creature(study.env))


def _run(
    folder: Path,
    creature: Creature,
    plan: "Plan",
    screen: "_Progress",
    cluster: str | None,
    begin: Callable[[], object] | None,
) -> bool:
    """Run a study on this machine or on a cluster; return False if interrupted.

    begin: makes the folder of a new study; called after the last check.
    """
    from mjxgait.distributed.evolve import scheduler_at
    from mjxgait.experiments.ablation.rows import run_study

    tell, stride = (screen.part, STRIDE) if cluster else (screen.generation, 1)
    with scheduler_at(cluster) as scheduler:
        if begin is not None:
            begin()
        with locked(folder):
            return run_study(folder, creature, plan, tell, scheduler, stride)


class _Progress(Progress):
    """Progress as plain lines; the time left is estimated from the generations so far."""

    def part(self, group: int, count: int, news: "News") -> None:
        """Report on one program of a study on a cluster, where several run at once."""
        if "compiling" in news:
            return
        self.output.say(
            f"rows {group + 1} of {count}: generation {news['generation']} of {news['of']}, "
            f"{news['steps'] / max(news['seconds'], 1e-9) / 1e6:.2f} M steps/s"
        )

    def generation(self, group: int, count: int, news: "News") -> None:
        where = f"program {group + 1} of {count}" if count > 1 else "all runs"
        if "compiling" in news:
            self.output.say(f"{where}: compiling for {news['compiling']} runs side by side")
            return
        if news["note"] and not news["generation"]:
            self.output.say(news["note"])
        left = news["of"] - news["generation"]
        self.output.say(
            f"{where}: generation {news['generation']} of {news['of']}, "
            f"{pace(news['steps'], news['seconds'], news['generations'], left)}"
        )


def _create(folder: Path, study: "Study", creature: Creature) -> None:
    """Make the folder of a study, with its exact settings and creature."""
    with writing(folder):
        write_creature(folder / CREATURE, creature.files)
        write_text(folder / STUDY, dump_toml(study))


def _open(folder: Path) -> tuple["Study", Creature]:
    from mjxgait.experiments.ablation.plan import Study

    if not (folder / STUDY).is_file():
        raise UserError(
            f"{folder}: not the folder of a study (it has no {STUDY}); name the folder that "
            "`mjxgait ablate` made"
        )
    table = read_toml(folder / STUDY)
    study = build(Study, table, str(folder / STUDY))
    check_whole(study, table, str(folder / STUDY))
    return study, load_creature(folder / CREATURE)


def _repeatable(options: AblateRequest) -> list[str]:
    """Return the options that decide the results, without folders.

    The report must not depend on where it is made.
    """
    if options.resume:
        return ["study.toml"]
    parts = [str(options.study)]
    for name in OVER:
        if getattr(options, name) is not None:
            parts += [f"--{name.replace('_', '-')}", str(getattr(options, name))]
    return parts


def _hours(steps: int, programs: int) -> float:
    return (steps / EXPECTED_SPEED + 20 * programs) / 3600
