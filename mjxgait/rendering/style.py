"""Style of all plots: line styles and hatches carry the meaning, so grey prints are legible."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from mjxgait.files import replaced

Figures = Mapping[str, tuple[tuple[float, float], Callable[[Figure], None]]]
"""Size in inches and drawing function by file name."""
FORMATS = ("png", "svg")
SETTINGS = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "hatch.linewidth": 0.5,
    "savefig.dpi": 120,
    "svg.hashsalt": "mjxgait",
}
DARK, MIDDLE, PALE = "0.1", "0.45", "0.85"
ACCENT = "tab:orange"


@contextmanager
def figure(size: tuple[float, float]) -> Iterator[Figure]:
    """Yield an empty figure of this size in inches, and close it at the end."""
    with plt.rc_context(SETTINGS):
        drawing = plt.figure(figsize=size, layout="constrained")
        try:
            yield drawing
        finally:
            plt.close(drawing)


def save(drawing: Figure, path: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write the figure once per format. path: without a suffix."""
    files = [path.with_name(f"{path.name}.{kind}") for kind in formats]
    for file in files:
        # Without a date, equal plots are equal files.
        with replaced(file) as beside:
            drawing.savefig(beside, metadata={"Date": None} if file.suffix == ".svg" else None)
    return files
