"""Small runs made by the command itself, once per process."""

import contextlib
import functools
import shutil
import tempfile
import tomllib
from pathlib import Path

import tomli_w
from end_to_end.shipped import TINY
from helpers import SHORT, STOOL
from rendering.made_up import falling, treading

from mjxgait.champion import write_champion
from mjxgait.cli import main
from mjxgait.creature import Creature
from mjxgait.training.folder import CERTIFICATE, CHAMPION, open_run

SMALL = """
[evolution]
population = 4
[rollout]
seconds = 0.3
lanes = 2
[examination]
candidates = 1
draws = 2
"""

_KNOWN = tomllib.loads(SHORT)
SHORTER = _KNOWN | {
    **{"seconds": 0.8, "warmup": 0.2},
    "pushes": _KNOWN["pushes"] | {"window": [0.3, 0.4], "ladder_seconds": 0.3},
    **{"hop": {"stay": 0.3}, "limbo": {"stay": 0.3}},
    **{"follow": {"moves": 0.4, "moved": 2}, "wishes": {"commands": 2}},
}
"""An examination of 0.8 s; a lamp must be at rest for the last 0.3 s, and lights move early."""


@functools.cache
def _made(*given: str) -> tempfile.TemporaryDirectory:
    """A run in a folder that lasts as long as the process."""
    folder = tempfile.TemporaryDirectory(prefix="mjxgait-end-to-end-")
    with contextlib.suppress(SystemExit):
        main(["train", *TINY, *given, "--out", f"{folder.name}/run"])
    return folder


def trained(folder: Path, *given: str) -> Path:
    """A copy of an evolved and examined run, by default the smallest creature's."""
    shutil.copytree(Path(_made(*(given or ("--env", str(STOOL)))).name) / "run", folder)
    return folder


def walker(folder: Path) -> Path:
    """The same with a champion that treads on the spot, which makes a loop."""
    return _with(treading, folder)


def faller(folder: Path) -> Path:
    """The same with a champion that falls at once, so that long trials take no time."""
    return _with(falling, folder)


def _with(made_up, folder: Path) -> Path:
    trained(folder)
    creature: Creature = open_run(folder)[0]
    write_champion(made_up(creature), creature, folder / CHAMPION)
    (folder / CERTIFICATE).unlink()
    return folder


def short_examination(folder: Path) -> str:
    """Examination settings for `certify`, which needs only the values that differ."""
    file = folder / "short.toml"
    file.write_text(tomli_w.dumps(SHORTER))
    return str(file)


def small_settings(folder: Path) -> str:
    """A settings file with few individuals and short episodes."""
    file = folder / "small.toml"
    file.write_text(SMALL)
    return str(file)
