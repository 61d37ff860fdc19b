"""What is around the bodies in a picture: floor, sand or water, and a light.

The medium and the light come from the simulation. Both renderers draw the same surroundings.
"""

import dataclasses

import numpy as np
from PIL import Image, ImageDraw

from mjxgait.rendering.floor import (
    BANDS,
    DARK_INK,
    STEPS,
    Camera,
    Relief,
    draw_floor,
    font,
    number_bands,
)

SAND = ((233, 218, 186), (230, 214, 181))
"""Colours of the bands on land for bodies that grew: nearly plain, so that a motion still shows."""
SHADE = (40, 44, 52)
"""Colour of a shadow."""
SURFACE, DEEP = np.array([204, 232, 242.0]), np.array([84, 148, 190.0])
"""Colours of water at the picture's upper and lower edge."""
SPECK, SPECK_PIXELS = np.array([244, 250, 252.0]), 0.005
"""Colour of a particle, and its radius in heights of the picture."""
APART, REACH = 0.3, 0.7
"""Distance between particles, and depth at which they fade out, in heights of the picture."""
MIXERS = (73856093, 19349663, 83492791)
IRRATIONAL = np.array([0.6180339887, 0.7548776662, 0.5698402910])
"""Numbers that turn a cell's place into the place of the particle in it."""
SUBTLE = 0.85
GLOW, GLOW_COLOUR, LAMP = 0.3, np.array([255, 226, 130.0]), 0.022
"""Radius of the light's glow in heights of the picture, its colour, and the radius of the lamp."""
BAR = 0.22
"""Largest length of the scale in water in widths of the picture."""


@dataclasses.dataclass(frozen=True, eq=False)
class Surroundings:
    """Surroundings of a scene. water: no floor. sand: instead of a grey floor. light: its place
    [3] m. clear: nothing is shown but the bodies and their shadow, on a transparent background.
    """

    water: bool = False
    sand: bool = False
    light: np.ndarray | None = None
    clear: bool = False

    @property
    def bands(self) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
        """Colours of the floor's bands."""
        return SAND if self.sand else BANDS


PLAIN = Surroundings()
"""A grey floor, without a light."""


def backdrop(
    camera: Camera, origin: np.ndarray, relief: Relief | None, around: Surroundings
) -> Image.Image:
    """Return the picture without bodies; see `draw_floor`. RGBA if it is clear."""
    if around.clear:
        return Image.new("RGBA", (camera.width, camera.height), (*SHADE, 0))
    return tank(camera) if around.water else draw_floor(camera, origin, relief, around.bands)


def write_marks(
    picture: Image.Image,
    camera: Camera,
    origin: np.ndarray,
    relief: Relief | None,
    around: Surroundings,
) -> None:
    """Draw what lies over a picture by GL: numbers of the floor or a scale, and the light."""
    if not around.water:
        number_bands(ImageDraw.Draw(picture), camera, origin, relief)
    write_over(picture, camera, around)


def write_over(picture: Image.Image, camera: Camera, around: Surroundings) -> None:
    """Draw what lies over the bodies: in water a scale, and the light."""
    if around.clear:
        return
    if around.light is not None:
        _draw_light(picture, camera, around.light)
    if around.water:
        _draw_scale(ImageDraw.Draw(picture), camera)


def tank(camera: Camera) -> Image.Image:
    """Return water: a vertical gradient, and particles that stand still in the world."""
    share = np.linspace(0, 1, camera.height)[:, None, None]
    column = (SURFACE + share * (DEEP - SURFACE)).round().astype(np.uint8)
    water = Image.fromarray(np.broadcast_to(column, (camera.height, camera.width, 3)).copy())
    draw, points = ImageDraw.Draw(water), particles(camera)
    near = 1 - (camera.depth(points) * camera.scale / (REACH * camera.height)) ** 2
    radius = max(SPECK_PIXELS * camera.height, 0.8)
    for (x, y), strength in zip(camera.pixels(points), SUBTLE * near, strict=True):
        row = min(max(int(y), 0), camera.height - 1)
        colour = column[row, 0] + strength * (SPECK - column[row, 0])
        size = radius * (0.6 + 0.4 * strength)
        draw.ellipse((x - size, y - size, x + size, y + size), tuple(colour.astype(int)))
    return water


def particles(camera: Camera) -> np.ndarray:
    """Return the places [n, 3] m of the particles that a camera sees, one in each cell of space."""
    high = camera.height / camera.scale
    cell = APART * high
    middle = np.floor(camera.centre / cell).astype(int)
    around = int(np.hypot(camera.width / camera.height, 1 + REACH) / 2 / APART) + 2
    steps = np.arange(-around, around + 1)
    cells = middle + np.stack(np.meshgrid(steps, steps, steps), -1).reshape(-1, 3)
    mixed = np.bitwise_xor.reduce(cells * np.array(MIXERS), axis=1) & 0xFFFFFF
    points = cell * (cells + mixed[:, None] * IRRATIONAL % 1.0)
    inside = (camera.pixels(points) > 0).all(1) & (
        camera.pixels(points) < [camera.width, camera.height]
    ).all(1)
    seen: np.ndarray = points[inside & (np.abs(camera.depth(points)) < REACH * high)]
    return seen


def _draw_light(picture: Image.Image, camera: Camera, place: np.ndarray) -> None:
    """Draw a lamp at its place; where that is outside the picture, its glow at the edge."""
    size = np.array(picture.size)
    towards = camera.pixels(place) - size / 2
    beyond = float((np.abs(towards) / (size / 2)).max())
    inside, radius = beyond <= 1, GLOW * camera.height
    centre = size / 2 + towards / max(beyond, 1.0)
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    away = np.hypot(x - centre[0], y - centre[1])
    strength = np.clip(1 - away / radius, 0, 1) ** 2
    if inside:
        strength = np.maximum(strength, np.clip(LAMP * camera.height + 1 - away, 0, 1))
    glow = Image.fromarray((255 * strength).astype(np.uint8))
    picture.paste(tuple(GLOW_COLOUR.astype(int)), mask=glow)
    if not inside:
        letters = font(max(camera.height // 26, 11))
        text = f"light {np.linalg.norm(place - camera.centre):.1f} m"
        draw = ImageDraw.Draw(picture)
        half = np.array([draw.textlength(text, letters) / 2 + 6, camera.height // 26 + 6])
        corner = np.clip(centre, half, size - half)
        draw.text(tuple(corner), text, fill=DARK_INK, font=letters, anchor="mm")


def _draw_scale(draw: ImageDraw.ImageDraw, camera: Camera) -> None:
    """Draw a bar of a round length in m at the lower left."""
    length = max((s for s in STEPS if s * camera.scale <= BAR * camera.width), default=STEPS[0])
    left, low = 14, camera.height - 12
    right = left + length * camera.scale
    for ends in (
        (left, low, right, low),
        (left, low - 4, left, low + 4),
        (right, low - 4, right, low + 4),
    ):
        draw.line(ends, fill=DARK_INK, width=1)
    size = max(camera.height // 26, 11)
    draw.text((left, low - 5), f"{length:g} m", fill=DARK_INK, font=font(size), anchor="ld")
