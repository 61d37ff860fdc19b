"""A walk as an image in a web page."""

import base64
import tempfile
from pathlib import Path

from mjxgait.rendering import video
from mjxgait.rendering.stage import Stage

SIZE, SECONDS, FPS = (420, 240), 3.0, 15
"""Pixels, s, and frames per second: small, because a notebook keeps the image."""


def walk_image(run: Path) -> str:
    """Return HTML with a run's champion walking; drawing takes a few seconds.

    Raises:
      UserError: no champion.
    """
    runner = video.champion_of(run, SECONDS)
    stage = Stage([runner.walk], *SIZE, None)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "walk.webp"
        video.write_video(video.moving_pictures([runner], stage, FPS, 1.0, None), file, FPS)
        data = base64.b64encode(file.read_bytes()).decode("ascii")
    return f'<img alt="the champion" src="data:image/webp;base64,{data}">'
