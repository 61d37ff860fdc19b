"""Results of several runs that differ by their seed: a table and a picture of their champions."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from rich.table import Table

from mjxgait.certification import read_certificate, verdict_of
from mjxgait.certification.advice import ADVICE
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.video import champion_of
from mjxgait.training.folder import CERTIFICATE, CHAMPION

COLUMNS = 4
SECONDS = 2.0
"""Time into its motion at which each champion is shown, s."""
SIZE = (420, 300)
"""Pixels of each champion's picture."""


@dataclasses.dataclass(frozen=True)
class SeedResult:
    """Result of one run.

    summary, advice: the certificate's. margin: None if not examined.
    """

    folder: Path
    certified: bool
    summary: str
    margin: float | None
    verdict: str
    """Result in a few words."""
    advice: tuple[str, ...] = ()


def found_in(folders: Sequence[Path]) -> list[SeedResult]:
    """Return the result of each run."""
    return [_found(folder) for folder in folders]


def table(found: Sequence[SeedResult]) -> Table:
    """Return the table for the screen, a row per run."""
    shown = Table(box=None, pad_edge=False)
    for heading in ("run", "motion", "margin", ""):
        shown.add_column(heading, justify="right" if heading == "margin" else "left")
    for one in found:
        margin = "" if one.margin is None else f"{one.margin:.2f}"
        shown.add_row(one.folder.name, one.summary, margin, one.verdict)
    return shown


def size(found: Sequence[SeedResult]) -> tuple[float, float]:
    """Return the picture's width and height in inches."""
    columns = min(len(found), COLUMNS)
    return 3.2 * columns, 0.4 + 2.8 * -(-len(found) // columns)


def draw_seeds(drawing: Figure, name: str, found: Sequence[SeedResult]) -> None:
    """Draw all champions as C MuJoCo simulates them, each as large as its picture allows."""
    columns = min(len(found), COLUMNS)
    fields = drawing.subplots(-(-len(found) // columns), columns, squeeze=False)
    for axes in fields.flat:
        axes.set_axis_off()
    for axes, one in zip(fields.flat, found, strict=False):
        if (one.folder / CHAMPION).is_file():
            stage = Stage([champion_of(one.folder, SECONDS).walk], *SIZE)
            axes.imshow(stage.picture(stage.frames - 1), interpolation="lanczos")
        axes.set_title(f"{one.folder.name}: {one.summary}\n{one.verdict}", fontsize=9)
    count = sum(one.certified for one in found)
    drawing.suptitle(
        f"{name.replace('_', ' ')}: {count} of {len(found)} certified; each has a scale of its own",
        fontsize=11,
    )


def _found(folder: Path) -> SeedResult:
    document = read_certificate(folder / CERTIFICATE)
    if document is None:
        return SeedResult(folder, False, "", None, "not examined")
    verdict, report = verdict_of(document), document.get("report", {})
    said = () if verdict.passed else tuple(report.get(ADVICE, ()))
    summary, words = report.get("summary", ""), verdict.in_words()
    return SeedResult(folder, verdict.certified, summary, verdict.margin, words, said)
