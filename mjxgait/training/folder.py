"""Run folder: file names, creation and reading.

A folder may come from anywhere, so its entries are only printed; the user decides to pass them on.
"""

import importlib.metadata
import re
import shlex
from collections.abc import Mapping
from pathlib import Path

import tomli_w

from mjxgait.certification.check_body import check_body
from mjxgait.champion import Champion, DamagedChampion, read_champion
from mjxgait.config.schema import Config, UseConfig
from mjxgait.config.tables import (
    check_whole,
    dump_toml,
    read_toml,
)
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.proportions import extreme_bodies
from mjxgait.errors import NotLoaded, UserError
from mjxgait.files import read_text, write_text, writing
from mjxgait.plugins import build_config
from mjxgait.plugins.fit import check_fit
from mjxgait.plugins.user_code import KINDS, places_of
from mjxgait.training.disk import require_writable

CONFIG, OWN = "config.toml", "own.toml"
"""Files in a run folder: settings; and FILE.py:CLASS of a user-defined controller or task."""


def keep_places(folder: Path, use: UseConfig) -> None:
    """Write the location of the run's user-defined code; nothing if it has none."""
    if places := places_of(use):
        write_text(folder / OWN, tomli_w.dumps(places))


def own_options(folder: Path) -> list[str]:
    """Return the options that name a run's user-defined code; empty if it has none.

    Without `own.toml` only the file's name is known, which refers to the current folder.
    """
    use, places = _table(folder / CONFIG).get("use"), _table(folder / OWN)
    options: list[str] = []
    for kind in KINDS:
        name = use.get(kind) if isinstance(use, dict) else None
        if isinstance(name, str) and ":" in name:
            options += [f"--{kind}", _shown(places.get(kind), name)]
    return options


def command(*words: object, run: Path) -> str:
    """Return a command as typed in a shell, with the options that the run needs."""
    return shlex.join(["mjxgait", *map(str, words), *own_options(run)])


def with_options(error: NotLoaded, folder: Path) -> NotLoaded:
    """Return the error with the run folder and the missing options."""
    return NotLoaded(f"{folder}: {error}", own_options(folder))


def _table(path: Path) -> dict[str, object]:
    try:
        return dict(read_toml(path))
    except UserError:
        return {}


def _shown(place: object, name: str) -> str:
    """Return the shortest path from the current folder; the name if the place is not recorded."""
    if not isinstance(place, str) or not place.isprintable():
        return name
    path = Path(place)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else place


MADE_BY = re.compile(r"# Settings of a run, by mjxgait (\S+)")
"""First line of the settings of a run."""


def own_version() -> str:
    """Return the version of this program."""
    return importlib.metadata.version("mjxgait")


def version_of(folder: Path) -> str | None:
    """Return the version of the program that made a run folder; None if it is not stored."""
    found = MADE_BY.match(read_text(folder / CONFIG))
    return found[1] if found else None


def _made_by(version: str) -> str:
    return f"# Settings of a run, by mjxgait {version}"


def _of_version(error: UserError, folder: Path) -> UserError:
    """Return the error about a run's settings; a shorter one if another version made the run."""
    made, own = version_of(folder), own_version()
    if made == own:
        return error
    by = f"mjxgait {made}" if made else "an earlier mjxgait"
    reason = str(error).removeprefix(f"{folder / CONFIG}: ").partition(";")[0]
    return UserError(
        f"{folder / CONFIG}: made by {by}; mjxgait {own} does not read its settings ({reason}); "
        "train it anew, or read it with the version that made it"
    )


CREATURE, METRICS, CHAMPION = "creature", "metrics.jsonl", "champion.json"
CERTIFICATE, STRESS, EXAMS = "certificate.json", "stress.json", "exams.jsonl"
PLOT, PLOTS, BODY = "fitness.png", "plots", "body"
ISLANDS, MIGRATIONS, ANCESTORS = "islands", "migrations.jsonl", "ancestors"
SKILLS = "skills"
"""Folder of run folders that show one skill each of the run's champion; see `skill_runs`."""


RUN_FILES = (CONFIG, OWN, METRICS, CHAMPION, CERTIFICATE, STRESS, EXAMS, PLOT, MIGRATIONS)
"""Files that a run writes and reads again."""


def require_output(path: Path) -> None:
    """Check before long work that a file may be written, and is none of a run's own.

    Raises:
      UserError: names the file, or the folder that is missing.
    """
    if path.name in RUN_FILES and (path.absolute().parent / CONFIG).is_file():
        raise UserError(f"{path}: the run's own file; name another one")
    require_writable(path)


def check_run(folder: Path | None, creature: Creature, config: Config) -> Path:
    """Return the folder for a new run, by default a new one under runs/. Writes nothing.

    Raises:
      UserError: the folder is not empty; controller or task does not fit the creature; or the
        creature's body cannot be examined.
    """
    check_parts(creature, config)
    folder = folder or new_run_folder(creature.name, config.seed)
    if is_taken(folder):
        holds = "another run" if (folder / CONFIG).exists() else "something else"
        raise UserError(
            f"{folder}: holds {holds}; name another folder with --out, or go on with --resume "
            f"{folder}"
        )
    return folder


def check_parts(creature: Creature, config: Config) -> None:
    """Refuse a controller or task that does not fit, and a body that cannot be examined.

    Bodies that grow are checked at their examination. If sizes evolve, the smallest and the largest
    body are checked.

    Raises:
      UserError: names the problem and the remedy.
    """
    check_fit(creature, config)
    if creature.settings.creature.grows:
        return
    pose_span = config.evolution.pose_span
    for body in (creature, *extreme_bodies(creature, config.evolution.body)):
        check_body(body.spanned(pose_span), pose_span)


def is_taken(folder: Path) -> bool:
    """Return whether a folder is not empty, or is a file.

    Raises:
      UserError: it cannot be read.
    """
    try:
        return folder.exists() and (not folder.is_dir() or any(folder.iterdir()))
    except OSError as error:
        raise UserError(f"{folder}: cannot be read ({error.strerror})") from None


def check_free(folder: Path, again: str = "--resume") -> None:
    """Refuse a folder for several new runs that is not empty.

    again: command or option that goes on with what the folder holds.

    Raises:
      UserError: it is not empty, or cannot be read.
    """
    if is_taken(folder):
        raise UserError(
            f"{folder}: holds something already; name another folder with --out, or go on with "
            f"{again} {folder}"
        )


def create_run(folder: Path | None, creature: Creature, config: Config) -> Path:
    """Create the run folder with the exact creature and settings, by default under runs/.

    Raises:
      UserError: see `check_run`; or the folder cannot be written.
    """
    folder = check_run(folder, creature, config)
    with writing(folder):
        write_setup(folder, creature, config)
    return folder


def write_setup(folder: Path, creature: Creature, config: Config) -> None:
    """Write the creature and the settings of a run into its folder."""
    write_creature(folder / CREATURE, creature.files)
    keep_places(folder, config.use)
    write_text(folder / CONFIG, f"{_made_by(own_version())}\n{dump_toml(config)}")


def shows_skill_of(folder: Path) -> Path | None:
    """Return the run if a folder shows one skill of its champion; None for any other folder."""
    skills = folder.absolute().parent
    return skills.parent if skills.name == SKILLS and (skills.parent / CONFIG).exists() else None


def write_creature(folder: Path, files: Mapping[str, str]) -> None:
    """Write a creature folder. files: texts by name."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_text(folder / name, text)


def new_run_folder(creature: str, seed: int) -> Path:
    """Return the first free folder name under runs/."""
    names = (
        f"{creature}-seed{seed}{suffix}" for suffix in ("", *(f"-{i}" for i in range(2, 10_000)))
    )
    return next(folder for name in names if not (folder := Path("runs") / name).exists())


def open_run(folder: Path) -> tuple[Creature, Config]:
    """Return the creature, on the ground of the run, and the settings of a run folder.

    Raises:
      UserError: it is not a run folder, or its controller or task was not named.
    """
    if not (folder / CONFIG).exists():
        raise UserError(f"{folder}: {_no_run(folder)}")
    table = read_toml(folder / CONFIG)
    try:
        config = build_config(table, str(folder / CONFIG))
        check_whole(config, table, str(folder / CONFIG))
    except NotLoaded as error:
        raise with_options(error, folder) from None
    except UserError as error:
        raise _of_version(error, folder) from None
    return load_creature(folder / CREATURE).on(config.rollout.ground), config


def _no_run(folder: Path) -> str:
    """Return why a folder is no run folder, and a run within it if there is one."""
    if not folder.is_dir():
        return "no such folder" if not folder.exists() else "a file; name a run folder"
    within = sorted(path.parent for path in folder.glob(f"*/{CONFIG}"))
    if within:
        return f"a folder of runs, and this is for one; name it, such as {within[0]}"
    return f"not a run folder (it has no {CONFIG})"


def open_champion(folder: Path) -> tuple[Creature, Champion]:
    """Return the body of a run folder's best individual, and that individual.

    Raises:
      UserError: it is not a run folder, or has no champion yet.
    """
    creature, _ = open_run(folder)
    champion = kept_champion(folder, creature)
    return champion.embodied(creature), champion


def kept_champion(folder: Path, creature: Creature) -> Champion:
    """Return the champion in `champion.json` of a run folder.

    Raises:
      UserError: there is none, it is damaged, or it is of another body.
    """
    try:
        return read_champion(folder / CHAMPION, creature)
    except DamagedChampion as error:
        again = command("train", "--resume", folder, run=folder)
        raise UserError(f"{error}; write it anew with: {again}") from None
