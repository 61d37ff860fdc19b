"""The floor with its scale: bands across the direction of travel and a ruler along it."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mjxgait.rendering.camera import Camera
from mjxgait.rendering.relief import Relief, draw_relief

BANDS = ((236, 237, 238), (225, 227, 229))
INK = (70, 74, 80)
DARK_INK = (38, 41, 46)
STEPS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Allowed widths of the bands in m."""
BAND_PIXELS = 70
FAR = 100.0
"""Reach of a band to either side in m."""


def draw_floor(camera: Camera, origin: np.ndarray, relief: Relief | None = None) -> Image.Image:
    """Draw bands of a round width in m with their numbers at the lower edge.

    origin: [2] m, where bands are counted from, along the creature's direction.

    relief: heights of uneven ground.
    """
    if relief is not None:
        picture = draw_relief(camera, origin, band_width(camera.scale), BANDS, relief)
        number_bands(ImageDraw.Draw(picture), camera, origin, relief)
        return picture
    picture = Image.new("RGB", (camera.width, camera.height), BANDS[0])
    draw = ImageDraw.Draw(picture)
    numbers, step = band_lines(camera, origin)
    ends = _line_ends(camera, origin, numbers, step)
    for i in np.flatnonzero(numbers[:-1] % 2):
        corners = [ends[i, 0], ends[i, 1], ends[i + 1, 1], ends[i + 1, 0]]
        draw.polygon([tuple(p) for p in corners], fill=BANDS[1])
    number_bands(draw, camera, origin)
    return picture


def band_lines(camera: Camera, origin: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the numbers of possibly visible lines between bands, and a band's width in m."""
    step = band_width(camera.scale)
    middle = int((camera.centre[:2] - origin) @ camera.forward // step)
    reach = (
        int(2 * (camera.width + camera.height) / np.sin(camera.elevation) / camera.scale / step) + 2
    )
    return np.arange(middle - reach, middle + reach), step


def band_width(scale: float) -> float:
    """Return the narrowest width in m with room for a number. scale: pixels/m."""
    return next((s for s in STEPS if s * scale >= BAND_PIXELS), STEPS[-1])


def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return Pillow's own font, so that none has to be installed."""
    return ImageFont.load_default(size)


def number_bands(
    draw: ImageDraw.ImageDraw, camera: Camera, origin: np.ndarray, relief: Relief | None = None
) -> None:
    """Draw a tick and a number where each line meets the lower edge.

    On uneven ground the lines lie at the ground's height in mid-picture.
    """
    numbers, step = band_lines(camera, origin)
    level = 0.0 if relief is None else float(relief(*camera.centre[:2]))
    ends = _line_ends(camera, origin, numbers, step, level)
    size = max(camera.height // 26, 11)
    letters = font(size)
    base = camera.height - size - 8
    for (near, far), number in zip(ends, numbers, strict=True):
        slope = (far[0] - near[0]) / (far[1] - near[1])
        x = near[0] + slope * (base - near[1])
        foot = near[0] + slope * (base - 6 - near[1])
        if -50 < x < camera.width + 50:
            draw.line([(x, base), (foot, base - 6)], fill=INK, width=1)
            places = 2 if step < 0.1 else 1 if step < 1 else 0
            draw.text(
                (x, base + 2), f"{number * step:.{places}f} m", fill=INK, font=letters, anchor="ma"
            )


def _line_ends(
    camera: Camera, origin: np.ndarray, numbers: np.ndarray, step: float, level: float = 0.0
) -> np.ndarray:
    """Pixels [n, 2, 2] of both ends of the lines between bands, at a height in m."""
    forward, start = np.append(camera.forward, 0.0), np.append(origin, level)
    left = np.cross([0.0, 0.0, 1.0], forward)
    along = start + numbers[:, None] * step * forward
    return camera.pixels(np.stack([along - FAR * left, along + FAR * left], 1))
