"""The folder of compiled programs, which JAX fills and later runs read."""

import os
from pathlib import Path
from typing import NamedTuple

from mjxgait.files import writing

VARIABLE = "JAX_COMPILATION_CACHE_DIR"
"""Environment variable of JAX that names another folder, which other programs may share."""
ENDINGS = ("-cache", "-atime")
"""Ends of the names of the files that JAX writes: a program, and the time of its latest use."""


class Programs(NamedTuple):
    """Contents of the folder. size: in bytes."""

    number: int
    size: int


def own_folder() -> Path:
    """Return the folder of compiled programs in the user's cache folder."""
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(cache) / "mjxgait" / "jax"


def named_folder() -> Path | None:
    """Return the folder that the environment names instead; None if it names none."""
    named = os.environ.get(VARIABLE)
    return Path(named) if named else None


def programs_in(folder: Path) -> Programs:
    """Count the compiled programs below a folder."""
    sizes = [file.stat().st_size for file in _files(folder) if file.name.endswith(ENDINGS[0])]
    return Programs(len(sizes), sum(sizes))


def clear(folder: Path) -> Programs:
    """Remove the compiled programs below a folder, and nothing else; return what was there.

    A run that goes on at the same time keeps its programs in memory.

    Raises:
      UserError: a file cannot be removed.
    """
    found = programs_in(folder)
    with writing(folder):
        for file in _files(folder):
            file.unlink(missing_ok=True)
    return found


def _files(folder: Path) -> list[Path]:
    return [file for file in sorted(folder.rglob("*")) if file.name.endswith(ENDINGS)]
