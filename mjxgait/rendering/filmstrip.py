"""Still pictures of a walk: filmstrip, onion skin, and the trade-off of keeping a cycle."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from mjxgait.rendering.curves import DARK, titled
from mjxgait.rendering.floor import DARK_INK, Camera, font
from mjxgait.rendering.gaitplots import gait_window, subject_of
from mjxgait.rendering.painter import paint
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import Walk

PICTURES = 8
SIZE = (420, 300)
"""Pixels of each picture."""


def filmstrip(
    walk: Walk,
    pictures: int = PICTURES,
    size: tuple[int, int] = SIZE,
    view: str | None = None,
    rows: int = 2,
    clear: bool = False,
) -> Image.Image:
    """Return one stride in rows of pictures, each with its part of the stride and its time.

    size: pixels of each picture. view, clear: see `Stage`; nothing is written on a clear one.
    """
    window, _ = gait_window(walk, 1)
    frames = np.round(np.linspace(window.start, window.stop, pictures, endpoint=False)).astype(int)
    stage = Stage([walk], *size, view, clear)
    columns = -(-pictures // rows)
    whole = columns * (size[0] + 4) - 4, rows * (size[1] + 4) - 4
    sheet = Image.new("RGBA", whole) if clear else Image.new("RGB", whole, "white")
    for i, frame in enumerate(frames):
        picture = stage.picture(int(frame))
        if not clear:
            share = (frame - window.start) / (window.stop - window.start)
            _write_moment(picture, share, frame * walk.time_step)
        row, column = divmod(i, columns)
        sheet.paste(picture, (column * (size[0] + 4), row * (size[1] + 4)))
    return sheet


def _write_moment(picture: Image.Image, share: float, time: float) -> None:
    """Write the part of the stride, and the time in s, at the upper edge."""
    draw = ImageDraw.Draw(picture)
    draw.text((10, 8), f"{share:.0%}", fill=DARK_INK, font=font(22))
    place = (picture.width - 10, 10)
    draw.text(place, f"{time:.2f} s", fill=DARK_INK, font=font(16), anchor="ra")


def draw_filmstrip(drawing: Figure, walk: Walk) -> None:
    """Draw the filmstrip as a figure, to be saved like the plots."""
    _, what = gait_window(walk, 1)
    axes = drawing.subplots()
    axes.imshow(filmstrip(walk), interpolation="lanczos")
    axes.set_axis_off()
    what = f"{what.replace('1 strides', 'one stride')}, in parts of the stride"
    axes.set_title(titled(subject_of(walk), what))


SPACING = 0.45
"""Approximate distance between moments in body lengths."""
MAX_MOMENTS = 30
"""Largest number of moments in a picture; a longer way spaces them farther apart."""
ROOM = 1.35
"""Height of the picture, in units of the highest point."""
HEIGHT, WIDEST = 420, 3000
"""Pixels."""
ELEVATION = np.radians(8.0)


def moments(walk: Walk) -> np.ndarray:
    """Return frames at even distances along the way, from the first to the farthest."""
    way = np.maximum.accumulate((walk.trunk_pos[:, :2] - walk.trunk_pos[0, :2]) @ walk.forward)
    count = min(round(way[-1] / (SPACING * walk.creature.frame.body_length)) + 1, MAX_MOMENTS)
    return np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], count)))


def strobe(walk: Walk) -> Image.Image:
    """Draw all moments from the side; the way sets the picture's width."""
    stage, frames = Stage([walk], 2 * HEIGHT, HEIGHT), moments(walk)
    (participant,) = stage.participants
    shown = [(participant.painter, *participant.poses(frame * walk.time_step)) for frame in frames]
    return paint(_camera(stage, walk, frames), shown, stage.origin, stage.relief, stage.around)


def draw_strobe(drawing: Figure, walk: Walk, picture: Image.Image) -> None:
    """Draw the picture as a figure, to be saved like the plots."""
    frames = moments(walk)
    axes = drawing.subplots()
    axes.imshow(picture, interpolation="lanczos")
    axes.set_axis_off()
    what = f"{len(frames)} moments of {frames[-1] * walk.time_step:.1f} s"
    axes.set_title(titled(subject_of(walk), what))


def strobe_shape(picture: Image.Image) -> tuple[float, float]:
    """Return the figure's size in inches."""
    width = min(14.0, 4.0 * picture.width / picture.height)
    return width, width * picture.height / picture.width + 0.6


def _camera(stage: Stage, walk: Walk, frames: np.ndarray) -> Camera:
    """Camera with room for the way, the body at both ends, and the highest point reached."""
    moved = walk.trunk_pos[frames] - walk.trunk_pos[0]
    way = moved[:, :2] @ walk.forward
    length = float(np.ptp(way)) + 2.4 * walk.creature.frame.body_length
    high = stage.participants[0].top + max(float(moved[:, 2].max()), 0.0)
    side = dataclasses.replace(stage.camera(0), azimuth=0.0, elevation=ELEVATION)
    scale = min(HEIGHT / (ROOM * high), WIDEST / length)
    middle = stage.origin + (way.min() + way.max()) / 2 * stage.forward
    return dataclasses.replace(
        side,
        centre=np.append(middle, 0.42 * high),
        scale=scale,
        width=round(length * scale),
        height=round(ROOM * high * scale),
    )


FRONT_PICTURES, FRONT_SIZE = 6, (300, 230)
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


def front_shape(kept: Sequence[Kept]) -> tuple[float, float]:
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
        title=f"{kept[0].walk.creature.title}: what the original costs; "
        "filled circles are certified",
    )
    above.yaxis.set_major_formatter("{x:.0%}")
    for axes, one in zip(strips, kept, strict=True):
        axes.imshow(
            filmstrip(one.walk, FRONT_PICTURES, FRONT_SIZE, rows=1), interpolation="lanczos"
        )
        axes.set_axis_off()
        verdict = "certified" if one.certified else "not certified"
        said = f"keep {one.keep:g}: {one.departs:.1f} degrees away, {verdict}"
        axes.set_title(f"{said}; {subject_of(one.walk)}")
