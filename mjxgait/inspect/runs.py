"""A folder full of runs: one line each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from mjxgait.errors import UserError
from mjxgait.inspect.facts import facts
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.inspect.text import ago, show
from mjxgait.runs.folder import CONFIG


def runs_in(folder: Path) -> list[Path]:
    """The run folders directly inside a folder, by name; empty when it is itself a run, or holds
    none.
    """
    if not folder.is_dir() or (folder / CONFIG).is_file():
        return []
    return sorted(entry for entry in folder.iterdir() if (entry / CONFIG).is_file())


def list_runs(runs: Sequence[Path]) -> list[dict[str, Any]]:
    """What there is to say of each run; one that cannot be read has the reason under `problem`."""
    kept = ("creature", "generation", "generations", "seed", "fitness", "ended", "written")
    lines = []
    for run in runs:
        try:
            found = facts(read_snapshot(run))
            lines.append({"run": str(run), "problem": None} | {key: found[key] for key in kept})
        except UserError as error:
            lines.append({"run": str(run), "problem": str(error)})
    return lines


def print_runs(lines: Sequence[Mapping[str, Any]], console: Console) -> None:
    """As a table, the problems below it."""
    table = Table(box=None, pad_edge=False)
    for heading in ("run", "creature", "generation", "best", "mean", "seed", "written", "state"):
        table.add_column(
            heading,
            justify="right" if heading in ("generation", "best", "mean", "seed") else "left",
        )
    for line in lines:
        name = Path(line["run"]).name
        if line["problem"]:
            table.add_row(name, *[""] * 6, "cannot be read")
            continue
        fitness = line["fitness"]
        table.add_row(
            name,
            line["creature"],
            f"{line['generation']}/{line['generations']}",
            show(fitness["best"]),
            show(fitness["mean"]),
            str(line["seed"]),
            ago(line["written"]),
            "finished" if line["ended"] else "not finished",
        )
    console.print(table)
    for line in lines:
        if line["problem"]:
            console.print(f"  {line['problem']}")
