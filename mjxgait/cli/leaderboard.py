"""`mjxgait leaderboard`: success rates per creature, task and algorithm."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class LeaderboardOptions:
    """Add runs to a table of success rates, or print the table.

    A run is added only if a second examination of its champion agrees with its certificate. Add all
    seeds of a series, also those that failed.

    Attributes:
      action: add or show.
      runs: Run folders to add.
      board: File of the table, a line per run.
      algorithm: Name of the algorithm; by default the controller's.
      machine: The machine in words, such as "2 cores of an AMD EPYC".
    """

    action: tyro.conf.Positional[Literal["show", "add"]] = "show"
    runs: tyro.conf.Positional[Annotated[tuple[Path, ...], tyro.conf.arg(metavar="[RUN ...]")]] = ()
    board: Path = Path("leaderboard.jsonl")
    algorithm: str | None = None
    machine: str = "not stated"


def leaderboard_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(LeaderboardOptions, "leaderboard", arguments)
    if (options.action == "add") != bool(options.runs):
        raise UserError("mjxgait leaderboard add RUN [RUN ...] adds runs; without both it shows")
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    from mjxgait.experiments.leaderboard import read_board, table

    if options.runs:
        _add(options)
    entries = read_board(options.board)
    print(table(entries).rstrip() if entries else f"{options.board}: no runs yet")
    return 0


def _add(options: LeaderboardOptions) -> None:
    """Add each run as soon as it is examined again; refuse what can be refused before that."""
    from mjxgait.api import verify
    from mjxgait.experiments.leaderboard import add, entry_of, with_new

    entries = [entry_of(run, options.algorithm, options.machine) for run in options.runs]
    with_new(options.board, entries)
    for run, entry in zip(options.runs, entries, strict=True):
        if different := verify(run):
            raise UserError(
                f"{run}: a second examination differs from its certificate: {different[0]}; "
                "it was not added"
            )
        add(options.board, entry)
        print(f"{run}: {'certified' if entry.certified else 'not certified'}, as before")
