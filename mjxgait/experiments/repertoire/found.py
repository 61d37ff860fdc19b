"""Reachable walks: each cell's examination, as values, as a table and as a picture."""

import dataclasses
import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from rich.table import Table

from mjxgait.certification import read_certificate, verdict_of
from mjxgait.certification.verdict import Document
from mjxgait.experiments.repertoire.grid import Cell, Grid
from mjxgait.rendering.curves import DARK, MIDDLE, PALE
from mjxgait.training.folder import CERTIFICATE

LINE = 20
"""Characters per line in a field of the picture."""


@dataclasses.dataclass(frozen=True)
class Found:
    """Result of one cell.

    speed: m/s, along the commanded heading. heading_off: deg, largest deviation from it. duty:
    mean duty factor of the feet. fails: criteria that it does not meet; none if certified or not
    examined. reservation: why it is not certified though it passes all.
    Numbers are None without a walk to measure.
    """

    cell: Cell
    certified: bool
    speed: float | None
    heading_off: float | None
    duty: float | None
    gait: str
    margin: float | None
    fails: tuple[str, ...]
    reservation: str = ""


def found_in(folder: Path, grid: Grid) -> list[Found]:
    """Return the result of each cell."""
    return [_found(cell, read_certificate(folder / cell.name / CERTIFICATE)) for cell in grid.cells]


def table(found: list[Found]) -> Table:
    """Return the table for the screen, a row per cell."""
    shown = Table(box=None, pad_edge=False)
    for heading in ("clip", "m/s", "target", "deg/s", "duty", "gait", "margin", "off deg", ""):
        shown.add_column(heading, justify="left" if heading in ("clip", "gait", "") else "right")
    for one in found:
        shown.add_row(
            one.cell.name,
            _number(one.speed),
            f"{one.cell.speed:.2f}",
            f"{one.cell.turn:+g}",
            _number(one.duty),
            one.gait,
            _number(one.margin),
            _number(one.heading_off),
            "certified" if one.certified else " ".join(_reason(one)),
        )
    return shown


def draw_map(drawing: Figure, creature: str, grid: Grid, found: list[Found]) -> None:
    """Draw a field per cell with its measurements, dark if certified."""
    axes = drawing.add_subplot()
    turns = sorted({cell.turn for cell in grid.cells}, reverse=True)
    for one in found:
        _field(axes, one, turns.index(one.cell.turn), grid.speeds.index(one.cell.speed))
    axes.set(xlim=(0, len(turns)), ylim=(0, len(grid.speeds)), ylabel="target speed (m/s)")
    axes.set_xlabel("target turn (deg/s), to the left on the left")
    axes.set_xticks(np.arange(len(turns)) + 0.5, [f"{turn:+g}" for turn in turns])
    axes.set_yticks(np.arange(len(grid.speeds)) + 0.5, [f"{speed:.2f}" for speed in grid.speeds])
    axes.grid(visible=False)
    count = sum(one.certified for one in found)
    axes.set_title(f"{creature}: {count} of {len(found)} walks are certified (dark)")


def _field(axes: Axes, one: Found, x: float, y: float) -> None:
    colour, hatch = (MIDDLE, "") if one.certified else ("1.0", "////")
    axes.add_patch(
        Rectangle((x, y), 1.0, 1.0, edgecolor=PALE, facecolor=colour, hatch=hatch, linewidth=1.0)
    )
    box = None if one.certified else {"facecolor": "white", "edgecolor": "none", "pad": 2}
    axes.text(
        x + 0.5,
        y + 0.5,
        _said(one),
        ha="center",
        va="center",
        fontsize=8,
        color="white" if one.certified else DARK,
        bbox=box,
    )


def _found(cell: Cell, document: Document | None) -> Found:
    if document is None:
        return Found(cell, False, None, None, None, "", None, ())
    report, verdict = document.get("report", {}), verdict_of(document)
    measures = [m for c in document["criteria"] for m in c["measures"]]
    off = [m["value"] for m in measures if m["name"].startswith("off the heading")]
    duty = [share for share in report.get("duty_factor", {}).values() if share is not None]
    return Found(
        cell,
        verdict.certified,
        report.get("speed"),
        off[0] if off else None,
        float(np.mean(duty)) if duty else None,
        report.get("gait") or "",
        verdict.margin,
        tuple(c.name for c in verdict.failed),
        verdict.reservation,
    )


def _said(one: Found) -> str:
    if one.certified:
        return f"{one.speed:.2f} m/s\n{one.gait}\nduty {one.duty:.2f}"
    return "\n".join(_reason(one))


def _reason(one: Found) -> list[str]:
    """Return in short lines why a cell is not certified."""
    if not one.fails:
        return textwrap.wrap(one.reservation or "not examined", LINE)
    more = len(one.fails) - 3
    return ["fails", *one.fails[:3], *([f"and {more} more"] if more > 0 else [])]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
