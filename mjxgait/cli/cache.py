"""`mjxgait cache`: the folder of compiled programs."""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import tyro

from mjxgait.cache import VARIABLE, Programs, clear, named_folder, own_folder, programs_in
from mjxgait.cli.options import parsed
from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class CacheOptions:
    """Show the folder of compiled programs and its size, or clear it.

    A run compiles nothing if its programs are there; after `clear` it compiles again.

    Attributes:
      action: clear removes the programs.
    """

    action: tyro.conf.Positional[Literal["show", "clear"]] = "show"


def cache_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(CacheOptions, "cache", arguments)
    folder = named_folder() or own_folder()
    if options.action == "show":
        print(f"{folder}: {in_words(programs_in(folder))}")
        return 0
    if named_folder():
        raise UserError(
            f"{folder}: named by {VARIABLE}, so other programs may share it; clear it yourself"
        )
    print(f"{folder}: removed {in_words(clear(folder))}")
    return 0


def in_words(found: Programs) -> str:
    """Return number and size of programs as text."""
    return f"{found.number} program{'' if found.number == 1 else 's'}, {found.size / 1e6:.1f} MB"
