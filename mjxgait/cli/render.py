"""`mjxgait render`: a video or a filmstrip of a run's champion, or a race."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mjxgait.cli.options import parsed, request_of


@dataclasses.dataclass(frozen=True)
class RenderOptions:
    """Make a video of a run's champion walking, or a race of several walks or runs.

    Attributes:
      runs: Run folder; several champions race, of any creatures.
      out: File to write: .webp, .gif, .mp4, .mov or .webm (these three: extra [video]), or .png for
        a filmstrip of one stride.
      top: Race of the best N of the latest population.
      generations: Race of the best of each of these generations, such as 0,5,20.
      seconds: Length of the walk; by default 5, for a filmstrip until its stride is steady.
      fps: Frames per second, 1 to 240, such as 23.976; a .gif holds up to 50.
      size: Width and height in pixels, by default 1280 720; for a filmstrip of each picture, by
        default 420 300.
      camera: Camera position; by default at the side, a little to the front and above.
      slow: Slow-motion factor.
      renderer: auto and painter need no GPU and no GL library; gl is MuJoCo's own renderer.
      background: transparent shows only the bodies and their shadow, without text; not for .mp4,
        nor by gl.
    """

    runs: tyro.conf.Positional[Annotated[tuple[Path, ...], tyro.conf.arg(metavar="RUN [RUN ...]")]]
    out: Path
    top: int | None = None
    generations: str | None = None
    seconds: float | None = None
    fps: float = 25.0
    size: tuple[int, int] | None = None
    camera: Literal["side", "front", "top", "three-quarter", "follow"] | None = None
    slow: float = 1.0
    renderer: Literal["auto", "painter", "gl"] = "auto"
    background: Literal["scene", "transparent"] = "scene"


def render_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(RenderOptions, "render", arguments)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    # If the variable names a missing GL library, the import of MuJoCo fails: only the drawing
    # process may see it.
    wanted = os.environ.pop("MUJOCO_GL", None)
    from mjxgait.api.films import Film, write_film

    write_film(request_of(Film, options), wanted, print)
    return 0
