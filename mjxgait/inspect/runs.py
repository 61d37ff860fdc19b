"""Summary of a folder of runs: one line each."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from mjxgait.errors import UserError
from mjxgait.inspect.facts import facts
from mjxgait.inspect.sections import Facts
from mjxgait.inspect.snapshot import read_snapshot
from mjxgait.inspect.text import ago, show
from mjxgait.training.folder import CONFIG
from mjxgait.training.lock import running, why_empty
from mjxgait.training.stored import stored_generations


def runs_in(folder: Path) -> list[Path]:
    """Return the run folders directly inside a folder, by name; empty if it is itself a run."""
    if not folder.is_dir() or (folder / CONFIG).is_file():
        return []
    return sorted(entry for entry in folder.iterdir() if (entry / CONFIG).is_file())


def just_begun(path: Path) -> dict[str, object] | None:
    """Return the summary of a running run without a checkpoint; None for others."""
    process = None if stored_generations(path) else running(path)
    return {"run": str(path), "problem": None, "running": process} if process else None


def print_just_begun(line: Facts, console: Console) -> None:
    """Print one sentence; see `just_begun`."""
    console.print(f"{line['run']}: {why_empty(Path(line['run']))}", markup=False)


def list_runs(runs: Sequence[Path]) -> list[dict[str, object]]:
    """Return a summary of each run.

    `problem` is the reason why a run cannot be read; `running` names the process that writes it.
    """
    kept = (
        "running",
        "creature",
        "generation",
        "generations",
        "seed",
        "fitness",
        "ended",
        "written",
        "trouble",
        "verdict",
    )
    lines = []
    for run in runs:
        if begun := just_begun(run):
            lines.append(begun)
            continue
        try:
            found = facts(read_snapshot(run))
            lines.append({"run": str(run), "problem": None} | {key: found[key] for key in kept})
        except UserError as error:
            lines.append({"run": str(run), "problem": str(error), "running": None})
    return lines


def print_runs(lines: Sequence[Facts], console: Console) -> None:
    """Print the runs as a table, with the problems below."""
    table = Table(box=None, pad_edge=False)
    numbers = ("generation", "best", "seed", "margin", "m/s")
    for heading in ("run", "creature", *numbers, "gait", "written", "state"):
        table.add_column(heading, justify="right" if heading in numbers else "left")
    for line in lines:
        name = Path(line["run"]).name
        if line["problem"]:
            table.add_row(name, *[""] * 8, "cannot be read")
            continue
        if "creature" not in line:
            table.add_row(name, *[""] * 8, "running")
            continue
        verdict = line["verdict"] or {}
        table.add_row(
            name,
            line["creature"],
            f"{line['generation']}/{line['generations']}",
            show(line["fitness"]["best"]),
            str(line["seed"]),
            _rounded(verdict.get("margin")),
            _rounded(verdict.get("speed")),
            verdict.get("gait") or "",
            ago(line["written"]),
            _state(line),
        )
    console.print(table)
    for line in lines:
        if said := line["problem"] or line.get("trouble"):
            console.print(f"  {said}", markup=False)


def _rounded(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _state(line: Facts) -> str:
    """Return the state of a run in a few words, or the reservation of its verdict."""
    if line["running"]:
        return "running"
    if line["trouble"]:
        return "champion unreadable"
    if not line["ended"]:
        return "not finished"
    if line["verdict"] is None:
        return "not examined"
    if line["verdict"]["certified"]:
        return "anywhere" if line["verdict"]["anywhere"] else "certified"
    if not line["verdict"]["failed"]:
        return line["verdict"]["reservation"] or "has no criteria"
    return f"fails {' '.join(map(str, line['verdict']['failed']))}"
