"""Location of a run's user-defined code, recorded in its run folder and never loaded from there.

A folder may come from anywhere, so its entries are only printed; the user decides to pass them on.
"""

import shlex
from pathlib import Path

import tomli_w

from mjxgait.config.schema import UseConfig
from mjxgait.config.tables import read_toml
from mjxgait.errors import NotLoaded, UserError
from mjxgait.files import write_text
from mjxgait.plugins.user_code import KINDS, places_of

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
