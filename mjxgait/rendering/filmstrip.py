"""The gait as a filmstrip: one stride in pictures, side by side."""

import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from mjxgait.rendering.floor import DARK_INK, font
from mjxgait.rendering.gaitplots import gait_window
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
) -> Image.Image:
    """Return one stride in rows of pictures, each with its part of the stride and its time.

    size: pixels of each picture. view: see `Stage`.
    """
    window, _ = gait_window(walk, 1)
    frames = np.round(np.linspace(window.start, window.stop, pictures, endpoint=False)).astype(int)
    stage = Stage([walk], *size, view)
    columns = -(-pictures // rows)
    sheet = Image.new("RGB", (columns * (size[0] + 4) - 4, rows * (size[1] + 4) - 4), "white")
    for i, frame in enumerate(frames):
        picture = stage.picture(int(frame))
        share = (frame - window.start) / (window.stop - window.start)
        draw = ImageDraw.Draw(picture)
        draw.text((10, 8), f"{share:.0%}", fill=DARK_INK, font=font(22))
        draw.text(
            (size[0] - 10, 10),
            f"{frame * walk.time_step:.2f} s",
            fill=DARK_INK,
            font=font(16),
            anchor="ra",
        )
        row, column = divmod(i, columns)
        sheet.paste(picture, (column * (size[0] + 4), row * (size[1] + 4)))
    return sheet


def draw_filmstrip(drawing: Figure, walk: Walk) -> None:
    """Draw the filmstrip as a figure, to be saved like the plots."""
    _, what = gait_window(walk, 1)
    axes = drawing.subplots()
    axes.imshow(filmstrip(walk), interpolation="lanczos")
    axes.set_axis_off()
    axes.set_title(
        f"{walk.creature.name.replace('_', ' ')}: {what.replace('1 strides', 'one stride')}, in "
        "parts of the stride"
    )
