"""`mjxgait gallery`: several champions on one page, in one picture, in one video."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from mjxgait.cli.options import Verbosity, parsed
from mjxgait.errors import UserError
from mjxgait.experiments.multi_seed import folders_of, is_multi_seed
from mjxgait.kinds import tasks, title_of
from mjxgait.output import silent
from mjxgait.training.folder import open_run

PAGE = "gallery.html"
WALKER, BLOCKS = "tall_quadruped", "blocks"


@dataclasses.dataclass(frozen=True)
class GalleryOptions(Verbosity):
    """Put several champions on one offline page, sorted by how they move.

    With --task it first evolves them, as `mjxgait train --runs` does; runs that are there already
    are continued or kept.

    Attributes:
      folders: Run folders, folders of runs, and studies.
      out: Page to write, ending with .html; with --task by default gallery.html among the runs.
      poster: Picture of all to write: .webp, .png or .jpg.
      video: Video of all to write: .webp, .gif or .mp4 (extra [video]).
      title: Title over all.
      task: Evolve champions of this task first.
      runs: With --task, number of runs.
      seed: With --task, seed of the first run.
      env: With --task, creature; by default blocks for every task that bodies that grow have.
      generations: With --task, most generations of each run.
      population: With --task, individuals of a generation.
      study: With --task, folder for the runs; by default runs/gallery-TASK.
    """

    folders: tyro.conf.Positional[
        Annotated[tuple[Path, ...], tyro.conf.arg(metavar="[RUN [RUN ...]]")]
    ] = ()
    out: Path | None = None
    poster: Path | None = None
    video: Path | None = None
    title: str = ""
    task: str | None = None
    runs: int | None = None
    seed: int | None = None
    env: str | None = None
    generations: int | None = None
    population: int | None = None
    study: Path | None = None


OF_TASK = ("runs", "seed", "env", "generations", "population", "study")
RUNS = 20
"""Default of --runs."""


def gallery_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(GalleryOptions, "gallery", arguments)
    folders = options.folders
    if options.task is None:
        _check_without_task(options)
        out = options.out
    else:
        if folders:
            raise UserError("gallery: name runs, or evolve them with --task; not both")
        study = options.study or Path("runs") / f"gallery-{options.task.rpartition(':')[2]}"
        folders, out = (study,), options.out or study / PAGE
    assert out is not None
    from mjxgait.api.galleries import check_files, gallery

    if options.task is not None:
        check_files(options.out, options.poster, options.video)
        if code := _evolve(options, folders[0]):
            return code
    tell = silent if options.quiet else print
    pictures = {"poster": options.poster, "video": options.video}
    gallery(folders, out, **pictures, title=options.title, tell=tell)
    return 0


def _check_without_task(options: GalleryOptions) -> None:
    given = [name for name in OF_TASK if getattr(options, name) is not None]
    if given:
        raise UserError(f"--{given[0]}: evolves runs, so it needs --task")
    if not options.folders:
        raise UserError(
            "gallery: name run folders, or evolve champions first with --task, such as --task swim"
        )
    if options.out is None:
        raise UserError(f"gallery: name the page to write, such as --out {PAGE}")


def _evolve(options: GalleryOptions, study: Path) -> int:
    """Evolve the runs of a folder, or continue them; return the exit code."""
    from mjxgait.cli.train import train_command

    quiet = ["--quiet"] if options.quiet else []
    if is_multi_seed(study):
        _check_same(options, study)
        return train_command(["--resume", str(study), *quiet])
    given = {
        "env": options.env or _usual_creature(options.task or ""),
        "use.task": options.task,
        "runs": RUNS if options.runs is None else options.runs,
        "out": study,
        "seed": options.seed,
        "generations": options.generations,
        "population": options.population,
    }
    words = [w for key, one in given.items() if one is not None for w in (f"--{key}", str(one))]
    return train_command([*words, *quiet])


def _check_same(options: GalleryOptions, study: Path) -> None:
    """Refuse other runs than those that a folder has.

    Raises:
      UserError: names the difference.
    """
    folders = folders_of(study)
    creature, config = open_run(folders[0])
    task = title_of(config.use.task)
    has = {
        "task": task,
        "runs": len(folders),
        "seed": config.seed,
        "env": creature.name,
        "generations": config.evolution.generations,
        "population": config.evolution.population,
    }
    for name, value in has.items():
        asked = getattr(options, name)
        same = asked is None or (title_of(asked) if name == "task" else asked) == value
        if not same:
            raise UserError(
                f"{study}: holds runs with --{name} {value}; leave --{name} {asked} out to keep "
                "them, or name another folder with --study"
            )


def _usual_creature(task: str) -> str:
    """The creature that has this task: one that grows, if any of that kind has it."""
    grown = {title_of(name) for name, kind in tasks().items() if kind.modular}
    return BLOCKS if task in grown else WALKER
