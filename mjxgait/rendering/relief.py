"""Uneven ground, drawn in facets from far to near, with the same bands as the floor."""

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

from mjxgait.rendering.camera import Camera

Relief = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Height in m at places x, y in m in the world; arrays of any shape."""
FACET_PIXELS = 14
"""Width of a facet in the picture."""
LIGHT = np.array([-0.25, -0.45, 0.85])
"""Direction towards the lamp, as (forward, left, up) of the creature."""
CONTRAST = 2.0
"""Change of brightness per unit of slope towards the lamp: more than physical, for visibility."""
DARKEST, BRIGHTEST = 0.7, 1.07


def draw_relief(
    camera: Camera,
    origin: np.ndarray,
    step: float,
    colours: tuple[tuple[int, int, int], tuple[int, int, int]],
    relief: Relief,
) -> Image.Image:
    """Return the ground in the camera's view; every other band of `step` m has the second colour.

    origin: [2] m, where bands are counted from, along the camera's forward.
    """
    picture = Image.new("RGB", (camera.width, camera.height), colours[0])
    draw = ImageDraw.Draw(picture)
    forward = camera.forward
    sideways = np.array([-forward[1], forward[0]])
    ahead, left = facet_lines(camera, origin, step, float(relief(*camera.centre[:2])))
    x, y = (origin[i] + ahead[None, :] * forward[i] + left[:, None] * sideways[i] for i in range(2))
    z = relief(x, y)
    corners = camera.pixels(np.stack([x, y, z], -1))
    light = _brightness(z, ahead, left)
    dark = np.floor((ahead[:-1] + ahead[1:]) / 2 / step).astype(int) % 2
    shades = np.clip(light[..., None] * np.array(colours)[dark], 0, 255).astype(int)
    for row in range(len(left) - 2, -1, -1):
        for i in range(len(ahead) - 1):
            quad = corners[[row, row, row + 1, row + 1], [i, i + 1, i + 1, i]]
            draw.polygon([tuple(p) for p in quad], fill=tuple(shades[row, i]))
    return picture


def facet_lines(
    camera: Camera, origin: np.ndarray, step: float, level: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return lines that cover the picture, in m ahead of and left of the origin; bands end on some.
    level: m, height of the ground in mid-picture.
    """
    sideways = np.array([-camera.forward[1], camera.forward[0]])
    into = camera.axes[2]
    # Point at which the middle ray meets the ground.
    middle = camera.centre[:2] - (camera.centre[2] - level) / into[2] * into[:2] - origin
    deep = camera.height / camera.scale / np.sin(camera.elevation)
    wide = camera.width / camera.scale / np.cos(camera.azimuth) + deep * np.tan(camera.azimuth)
    facet = FACET_PIXELS / camera.scale
    along = step / max(round(step / facet), 1)
    first = np.floor((middle @ camera.forward - 0.7 * wide) / along)
    ahead = (first + np.arange(int(1.4 * wide / along) + 2)) * along
    across = facet / np.sin(camera.elevation)
    rows = np.arange(int(1.6 * deep / across) + 2) - int(0.8 * deep / across)
    # Lines stay fixed on the ground, so that nothing flickers in a video.
    return ahead, (np.round(middle @ sideways / across) + rows) * across


def _brightness(z: np.ndarray, ahead: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Brightness [rows, columns] of each facet, 1 if level."""
    by_left, by_ahead = np.gradient(z, left, ahead)
    steep = -(by_ahead * LIGHT[0] + by_left * LIGHT[1])
    middle = (steep[1:, 1:] + steep[1:, :-1] + steep[:-1, 1:] + steep[:-1, :-1]) / 4
    return np.clip(1 + CONTRAST * middle, DARKEST, BRIGHTEST)
