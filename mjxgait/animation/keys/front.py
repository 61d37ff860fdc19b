"""Several runs near one cycle in one folder, from the cycle as drawn to a free walk."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mjxgait.animation.keys.departure import departure
from mjxgait.animation.keys.refine import FARTHEST, KEYS, read_original
from mjxgait.certification import criteria_of, judged, read_certificate
from mjxgait.errors import UserError
from mjxgait.rendering.cast import LOOP_SECONDS, champion_of
from mjxgait.rendering.front import Kept, draw_front, shape
from mjxgait.rendering.style import figure, save
from mjxgait.training.disk import disk_errors
from mjxgait.training.folder import CERTIFICATE, is_taken, open_run

PICTURE = "front"
STARTS = 4
"""Number of the criterion on disturbed starts that stay up."""


def folder_of(out: Path, keep: float) -> Path:
    """Folder of the run that keeps this share."""
    return out / f"keep-{keep:g}"


def runs_in(out: Path) -> list[Path]:
    """The runs of a front, the most faithful first; empty if the folder is no front."""
    found = [run for run in out.glob("keep-*") if (run / KEYS).is_file()]
    return sorted(found, key=kept_by, reverse=True)


def kept_by(run: Path) -> float:
    """The share of the original that a run keeps."""
    return round(1.0 - open_run(run)[1].controller.within / FARTHEST, 6)


def check_front(out: Path, keeps: Sequence[float]) -> None:
    """Refuse to begin in a folder that is in use.

    Raises:
      UserError: the folder is not empty, or a share is there twice.
    """
    if is_taken(out):
        raise UserError(
            f"{out}: holds something already; name another folder with --out, or go on with "
            f"mjxgait refine --resume {out}"
        )
    if len(set(keeps)) < len(keeps):
        raise UserError("--keep: a share is there twice")


def finished(run: Path) -> bool:
    """True if the run's champion has a certificate."""
    return (run / CERTIFICATE).is_file()


def look(run: Path) -> Kept:
    """The result of a finished run."""
    document = read_certificate(run / CERTIFICATE)
    if document is None:
        raise UserError(f"{run}: has no certificate yet; mjxgait refine --resume {run}")
    found = {c.number: c for c in criteria_of(document)}
    if STARTS not in found:
        raise UserError(f"{run / CERTIFICATE}: has no criterion {STARTS}; mjxgait certify {run}")
    walk = champion_of(run, LOOP_SECONDS).walk
    return Kept(
        kept_by(run),
        departure(read_original(run, walk.creature), walk).poses,
        float(np.nan_to_num(found[STARTS].measures[0].value)),
        judged(document).certified,
        walk,
    )


def draw(out: Path) -> Path:
    """Draw a front of finished runs, and return the path of the picture.

    Raises:
      UserError: a run has no certificate yet, or the picture cannot be written.
    """
    kept = [look(run) for run in runs_in(out)]
    with disk_errors(out), figure(shape(kept)) as drawing:
        draw_front(drawing, kept)
        return save(drawing, out / PICTURE, ("png",))[0]
