"""`mjxgait inspect`: contents of a checkpoint, a run or a folder of runs."""

import dataclasses
import json
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypedDict, TypeVar

import tyro
from rich.console import Console

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError

PIPED_WIDTH = 160
Found = TypeVar("Found")


class Verified(TypedDict):
    """Result of `--verify`."""

    run: str
    equal: bool
    differences: list[str]


@dataclasses.dataclass(frozen=True)
class InspectOptions:
    """Show the contents of a checkpoint, without compiling; only --verify simulates.

    Attributes:
      path: Run folder, one of its checkpoints, or a folder of runs.
      generation: Generation of the checkpoint, instead of the latest.
      individual: Rank of one individual to show in full; 1 is the best.
      all: Show the whole population instead of its best ten.
      diff: Two runs or checkpoints to compare.
      verify: Examine the champion of a run again, and compare every measure with its certificate.
        The exit code is 0 only if all are equal (docs/reference/certificate.md).
      json: Print JSON for programs.
    """

    path: tyro.conf.Positional[Path | None] = None
    generation: int | None = None
    individual: int | None = None
    all: bool = False
    diff: tuple[Path, Path] | None = None
    verify: bool = False
    json: bool = False


def inspect_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(InspectOptions, "inspect", arguments)
    # Reading needs no accelerator, and a broken one must not prevent it. Must precede the import of
    # JAX.
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    from mjxgait import inspect

    # Names of runs are not markup.
    width = None if sys.stdout.isatty() else PIPED_WIDTH
    console = Console(highlight=False, markup=False, width=width)

    def tell(found: Found, show: Callable[[Found, Console], object]) -> int:
        if options.json:
            print(json.dumps(found, indent=2, allow_nan=False))
        else:
            show(found, console)
        return 0

    if options.verify:
        found = _verified(options)
        tell(found, _print_verified)
        return 0 if found["equal"] else 1
    _check_paths(options)
    if options.diff:
        return tell(
            inspect.differences(*map(inspect.read_snapshot, options.diff)),
            inspect.print_differences,
        )
    assert options.path is not None
    if runs := inspect.runs_in(options.path):
        return tell(inspect.list_runs(runs), inspect.print_runs)
    if begun := inspect.just_begun(options.path):
        return tell(begun, inspect.print_just_begun)
    snapshot = inspect.read_snapshot(options.path, options.generation)
    if options.individual is not None:
        return tell(
            inspect.individual_facts(snapshot, options.individual), inspect.print_individual
        )
    return tell(inspect.facts(snapshot), partial(inspect.print_facts, few=not options.all))


def _check_paths(options: InspectOptions) -> None:
    """Refuse `--diff` beside anything else, and no path without it."""
    others = options.path, options.generation, options.individual
    if options.diff and any(other is not None for other in others):
        raise UserError(
            "--diff takes two runs or checkpoints (such as RUN/checkpoints/5) and nothing else "
            "but --json"
        )
    if not options.diff and options.path is None:
        raise UserError(
            "name a run folder, a checkpoint, or a folder full of runs: mjxgait inspect "
            "runs/tall_quadruped-seed0"
        )


def _verified(options: InspectOptions) -> Verified:
    """Compare a second examination of a run's champion with its certificate."""
    others = options.generation, options.individual, options.diff
    if options.path is None or any(option is not None for option in others) or options.all:
        raise UserError("--verify takes one run folder and nothing else but --json")
    from mjxgait.api import verify

    differences = verify(options.path)
    return {"run": str(options.path), "equal": not differences, "differences": differences}


def _print_verified(found: Verified, console: Console) -> None:
    if found["equal"]:
        console.print("Examined again: every measure is that of the certificate.", markup=False)
        return
    console.print("Examined again: the certificate says something else.", markup=False)
    for difference in found["differences"]:
        console.print(f"  {difference}", markup=False)
