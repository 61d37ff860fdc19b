"""Where the user's own code of a run lies: its run folder says so, and never has it loaded.

A folder may come from anywhere, so what it says is only printed: the user passes it on, or not.
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
"""In a run folder: its settings; and FILE.py:CLASS of its controller and of its task, where they are
the user's."""


def keep_places(folder: Path, use: UseConfig) -> None:
    """Write where the loaded code of the user's lies that takes part; nothing where there is none."""
    if places := places_of(use):
        write_text(folder / OWN, tomli_w.dumps(places))


def own_options(folder: Path) -> list[str]:
    """Return the options that name the user's own code of a run; none where it has none.

    A run folder without `own.toml` gives only the name of the file: that is where the user is.
    """
    use, places = _table(folder / CONFIG).get("use"), _table(folder / OWN)
    options: list[str] = []
    for kind in KINDS:
        name = use.get(kind) if isinstance(use, dict) else None
        if isinstance(name, str) and ":" in name:
            options += [f"--{kind}", _shown(places.get(kind), name)]
    return options


def command(*words: object, run: Path) -> str:
    """Return a command as the user has to type it, with the options that the run needs."""
    return shlex.join(["mjxgait", *map(str, words), *own_options(run)])


def with_options(error: NotLoaded, folder: Path) -> NotLoaded:
    """Return the error with the folder that it is about, and the options that are missing."""
    return NotLoaded(f"{folder}: {error}", own_options(folder))


def _table(path: Path) -> dict[str, object]:
    try:
        return dict(read_toml(path))
    except UserError:
        return {}


def _shown(place: object, name: str) -> str:
    """Return a place as short as it can be from here; the name where the folder does not say it."""
    if not isinstance(place, str) or not place.isprintable():
        return name
    path = Path(place)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else place
