"""Trade-off plot of keeping a drawn cycle: steadiness over distance from the original, and a
filmstrip of each walk.
"""

import dataclasses
from collections.abc import Sequence

from matplotlib.figure import Figure

from mjxgait.rendering.filmstrip import filmstrip
from mjxgait.rendering.style import DARK
from mjxgait.rendering.walk import Walk

PICTURES, SIZE = 6, (300, 230)
WIDE, HIGH, PLOT = 12.0, 1.9, 3.4
"""Width of the picture, and heights of a filmstrip and of the plot, in inches."""


@dataclasses.dataclass(frozen=True, eq=False)
class Kept:
    """A walk near a cycle.

    keep: requested share of the original. departs: deg, root mean square distance of its key poses.
    stays: share of the disturbed starts that stay up. certified: whether it passes all criteria.
    """

    keep: float
    departs: float
    stays: float
    certified: bool
    walk: Walk


def shape(kept: Sequence[Kept]) -> tuple[float, float]:
    """Return the picture's size in inches."""
    return WIDE, PLOT + HIGH * len(kept)


def draw_front(drawing: Figure, kept: Sequence[Kept]) -> None:
    """Draw the plot, and below it a filmstrip for each walk in the order given."""
    above, *strips = drawing.subplots(1 + len(kept), 1, height_ratios=[PLOT, *[HIGH] * len(kept)])
    order = sorted(kept, key=lambda one: one.departs)
    above.plot([k.departs for k in order], [k.stays for k in order], color=DARK, linestyle=":")
    for one in kept:
        filled = DARK if one.certified else "white"
        above.plot(one.departs, one.stays, "o", color=DARK, markerfacecolor=filled, markersize=8)
        above.annotate(
            f"keep {one.keep:g}", (one.departs, one.stays), (7, -12), textcoords="offset points"
        )
    above.set(
        xlabel="key poses moved by, degrees (root mean square)",
        ylabel="disturbed starts that stay up",
        ylim=(-0.05, 1.08),
        title="What the original costs: filled circles are certified",
    )
    above.yaxis.set_major_formatter("{x:.0%}")
    for axes, one in zip(strips, kept, strict=True):
        axes.imshow(filmstrip(one.walk, PICTURES, SIZE, rows=1), interpolation="lanczos")
        axes.set_axis_off()
        verdict = "certified" if one.certified else "not certified"
        axes.set_title(f"keep {one.keep:g}: {one.departs:.1f} degrees away, {verdict}")
