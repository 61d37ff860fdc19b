"""Onion-skin picture: the creature at many moments along its way."""

import dataclasses

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from mjxgait.rendering.camera import Camera
from mjxgait.rendering.painter import paint
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import Walk

SPACING = 0.45
"""Approximate distance between moments in body lengths."""
MOST = 30
"""Largest number of moments in a picture; a longer way spaces them farther apart."""
ROOM = 1.35
"""Height of the picture, in units of the highest point."""
HEIGHT, WIDEST = 420, 3000
"""Pixels."""
ELEVATION = np.radians(8.0)


def moments(walk: Walk) -> np.ndarray:
    """Return frames at even distances along the way, from the first to the farthest."""
    way = np.maximum.accumulate((walk.trunk_pos[:, :2] - walk.trunk_pos[0, :2]) @ walk.forward)
    count = min(round(way[-1] / (SPACING * walk.creature.frame.body_length)) + 1, MOST)
    return np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], count)))


def strobe(walk: Walk) -> Image.Image:
    """Draw all moments from the side; the way sets the picture's width."""
    stage, frames = Stage([walk], 2 * HEIGHT, HEIGHT), moments(walk)
    (entrant,) = stage.entrants
    shown = [(entrant.painter, *entrant.poses(frame * walk.time_step)) for frame in frames]
    return paint(_camera(stage, walk, frames), shown, stage.origin, stage.relief)


def draw_strobe(drawing: Figure, walk: Walk, picture: Image.Image) -> None:
    """Draw the picture as a figure, to be saved like the plots."""
    frames = moments(walk)
    axes = drawing.subplots()
    axes.imshow(picture, interpolation="lanczos")
    axes.set_axis_off()
    name, seconds = walk.creature.name.replace("_", " "), frames[-1] * walk.time_step
    axes.set_title(f"{name}: {len(frames)} moments of {seconds:.1f} s")


def shape(picture: Image.Image) -> tuple[float, float]:
    """Return the figure's size in inches."""
    width = min(14.0, 4.0 * picture.width / picture.height)
    return width, width * picture.height / picture.width + 0.4


def _camera(stage: Stage, walk: Walk, frames: np.ndarray) -> Camera:
    """Camera with room for the way, the body at both ends, and the highest point reached."""
    moved = walk.trunk_pos[frames] - walk.trunk_pos[0]
    way = moved[:, :2] @ walk.forward
    length = float(np.ptp(way)) + 2.4 * walk.creature.frame.body_length
    high = stage.entrants[0].top + max(float(moved[:, 2].max()), 0.0)
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
