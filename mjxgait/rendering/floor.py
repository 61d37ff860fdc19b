"""Camera with parallel rays, and the floor that it shows."""

import dataclasses
from collections.abc import Callable
from functools import cached_property

import numpy as np
from PIL import Image, ImageDraw, ImageFont

UP = np.array([0.0, 0.0, 1.0])
SMOOTH = 2
"""Drawn pixels per pixel and direction, so that edges are smooth."""
VIEWS = {
    "side": (0.0, 8.0),
    "front": (75.0, 12.0),
    "top": (0.0, 80.0),
    "three-quarter": (45.0, 24.0),
    "follow": (-68.0, 24.0),
}
"""Azimuth and elevation in deg by name. None is exactly from ahead or above, where a floor has no
depth to measure with."""


def view_of(name: str) -> dict[str, float]:
    """Return azimuth and elevation of a view in rad."""
    azimuth, elevation = VIEWS[name]
    return {"azimuth": float(np.radians(azimuth)), "elevation": float(np.radians(elevation))}


@dataclasses.dataclass(frozen=True, eq=False)
class Camera:
    """View from a creature's right side, slightly from the front and from above: it walks to the
    right.

    centre: [3] m, in the middle of the picture. forward: [2] unit, the creature's direction. scale:
    pixels/m. width, height: pixels.
    azimuth: rad, from the side towards the front. elevation: rad.
    """

    centre: np.ndarray
    forward: np.ndarray
    scale: float
    width: int
    height: int
    azimuth: float = np.radians(22.0)
    elevation: float = np.radians(16.0)

    @cached_property
    def axes(self) -> np.ndarray:
        """Unit rows [3, 3]: right in the picture, up in the picture, into the scene."""
        forward = np.append(self.forward, 0.0)
        left = np.cross(UP, forward)
        right = np.cos(self.azimuth) * forward + np.sin(self.azimuth) * left
        flat = np.cross(UP, right)
        into = np.cos(self.elevation) * flat - np.sin(self.elevation) * UP
        return np.stack([right, np.cross(right, into), into])

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Return the pixels [..., 2] (right, down) of world points [..., 3] m."""
        across = (points - self.centre) @ self.axes[:2].T * [self.scale, -self.scale]
        return across + np.array([self.width, self.height]) / 2

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Return the depth [...] in m of world points [..., 3]."""
        return (points - self.centre) @ self.axes[2]

    def offsets(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far in m pixel middles are right [columns] of and above [rows] the centre."""
        return (
            (columns + 0.5 - self.width / 2) / self.scale,
            -(rows + 0.5 - self.height / 2) / self.scale,
        )

    def enlarged(self, factor: int) -> "Camera":
        """Return the same view with more pixels."""
        return dataclasses.replace(
            self, scale=self.scale * factor, width=self.width * factor, height=self.height * factor
        )

    def cropped(self, box: tuple[int, int, int, int]) -> "Camera":
        """Return the same view of a part of the picture. box: left, upper, right, lower pixel."""
        left, upper, right, lower = box
        aside = np.array([left + right - self.width, self.height - upper - lower]) / 2 / self.scale
        return dataclasses.replace(
            self,
            centre=self.centre + aside @ self.axes[:2],
            width=right - left,
            height=lower - upper,
        )


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
    picture = Image.new("RGB", (SMOOTH * camera.width, SMOOTH * camera.height), colours[0])
    draw = ImageDraw.Draw(picture)
    forward = camera.forward
    sideways = np.array([-forward[1], forward[0]])
    ahead, left = facet_lines(camera, origin, step, float(relief(*camera.centre[:2])))
    x, y = (origin[i] + ahead[None, :] * forward[i] + left[:, None] * sideways[i] for i in range(2))
    z = relief(x, y)
    corners = SMOOTH * camera.pixels(np.stack([x, y, z], -1))
    light = _brightness(z, ahead, left)
    dark = np.floor((ahead[:-1] + ahead[1:]) / 2 / step).astype(int) % 2
    shades = np.clip(light[..., None] * np.array(colours)[dark], 0, 255).astype(int)
    for row in range(len(left) - 2, -1, -1):
        for i in range(len(ahead) - 1):
            quad = corners[[row, row, row + 1, row + 1], [i, i + 1, i + 1, i]]
            draw.polygon([tuple(p) for p in quad], fill=tuple(shades[row, i]))
    return picture.reduce(SMOOTH)


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


BANDS = ((236, 237, 238), (225, 227, 229))
INK = (70, 74, 80)
DARK_INK = (38, 41, 46)
STEPS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Allowed widths of the bands in m."""
BAND_PIXELS = 70
FAR = 100.0
"""Reach of a band to either side in m."""


def draw_floor(
    camera: Camera,
    origin: np.ndarray,
    relief: Relief | None = None,
    bands: tuple[tuple[int, int, int], tuple[int, int, int]] = BANDS,
) -> Image.Image:
    """Draw bands of a round width in m with their numbers at the lower edge.

    Args:
      origin: [2] m, where bands are counted from, along the creature's direction.
      relief: heights of uneven ground.
      bands: the two colours of the bands.
    """
    if relief is not None:
        picture = draw_relief(camera, origin, band_width(camera.scale), bands, relief)
        number_bands(ImageDraw.Draw(picture), camera, origin, relief)
        return picture
    picture = Image.new("RGB", (camera.width, camera.height), bands[0])
    dark = Image.new("L", (SMOOTH * camera.width, SMOOTH * camera.height))
    draw = ImageDraw.Draw(dark)
    numbers, step = band_lines(camera, origin)
    ends = SMOOTH * _line_ends(camera, origin, numbers, step)
    for i in np.flatnonzero(numbers[:-1] % 2):
        corners = [ends[i, 0], ends[i, 1], ends[i + 1, 1], ends[i + 1, 0]]
        draw.polygon([tuple(p) for p in corners], fill=255)
    picture.paste(bands[1], mask=dark.reduce(SMOOTH))
    number_bands(ImageDraw.Draw(picture), camera, origin)
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
