"""`mjxgait render`: a video or a filmstrip of a run's champion, or a race."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError
from mjxgait.files import replaced, writing

if TYPE_CHECKING:
    from mjxgait.rendering.stage import Stage
    from mjxgait.rendering.video import Runner

MOST_RUNNERS = 12
SIZE = (640, 360)
"""Pixels of a video."""
SECONDS = 5.0
"""Length of a video."""


@dataclasses.dataclass(frozen=True)
class RenderOptions:
    """Make a video of a run's champion walking, or a race of several walks or runs.

    Attributes:
      runs: Run folder; several champions race, of any creatures.
      out: File to write: .webp, .gif, .mp4 (extra [video]), or .png for a filmstrip of one stride.
      top: Race of the best N of the latest population.
      generations: Race of the best of each of these generations, such as 0,5,20.
      seconds: Length of the walk; by default 5, for a filmstrip until its stride is steady.
      fps: Frames per second.
      size: Width and height in pixels, by default 640 360; for a filmstrip of each picture, by
        default 420 300.
      camera: Camera position; by default at the side, a little to the front and above.
      slow: Slow-motion factor.
      renderer: painter needs no GPU and no GL library; gl is MuJoCo's own; auto uses gl where it
        works.
    """

    runs: tyro.conf.Positional[Annotated[tuple[Path, ...], tyro.conf.arg(metavar="RUN [RUN ...]")]]
    out: Path
    top: int | None = None
    generations: str | None = None
    seconds: float | None = None
    fps: int = 25
    size: tuple[int, int] | None = None
    camera: Literal["side", "front", "top", "three-quarter", "follow"] | None = None
    slow: float = 1.0
    renderer: Literal["auto", "painter", "gl"] = "auto"


def render_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(RenderOptions, "render", arguments)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    # If the variable names a missing GL library, the import of MuJoCo fails: only the drawing
    # process may see it.
    wanted = os.environ.pop("MUJOCO_GL", None)
    from mjxgait.rendering import video
    from mjxgait.rendering.stage import Stage
    from mjxgait.rendering.walk import doubt

    generations = _check(options)
    video.require_writer(options.out)
    still = options.out.suffix.lower() == ".png"
    alone = not (options.top or generations or len(options.runs) > 1)
    seconds = options.seconds or (video.LOOP_SECONDS if still and alone else SECONDS)
    if alone:
        runners = [video.champion_of(options.runs[0], seconds)]
    elif options.top:
        runners = video.top_of(options.runs[0], options.top, seconds)
    elif generations:
        runners = video.through_generations(options.runs[0], generations, seconds)
    else:
        runners = video.champions_of(options.runs, seconds)
    stage = Stage([runner.walk for runner in runners], *(options.size or SIZE), options.camera)
    if still:
        _still(runners, stage, options)
    else:
        backend = _backend(stage, options, wanted)
        video.write_video(
            video.moving_pictures(runners, stage, options.fps, options.slow, backend),
            options.out,
            options.fps,
        )
    print(f"{options.out} ({options.out.stat().st_size / 1024:,.0f} KiB)")
    if not (options.top or generations):
        for run, runner in zip(options.runs, runners, strict=True):
            if said := doubt(run, runner.walk):
                print(f"{runner.label}: {said}" if runner.label else said)
    return 0


def _check(options: RenderOptions) -> list[int]:
    """Check the options, and return the requested generations.

    Raises:
      UserError: an invalid option, by name.
    """
    for name, value, low, high in (
        ("fps", options.fps, 1, 60),
        ("seconds", SECONDS if options.seconds is None else options.seconds, 0.1, 600),
        ("slow", options.slow, 0.1, 100),
        ("size", min(options.size or SIZE), 64, 4096),
        ("size", max(options.size or SIZE), 64, 4096),
        ("top", options.top or 1, 1, MOST_RUNNERS),
    ):
        if not low <= value <= high:
            raise UserError(f"--{name} {value}: must lie between {low} and {high}")
    if not 1 <= len(options.runs) <= MOST_RUNNERS:
        raise UserError(f"name a run folder, or up to {MOST_RUNNERS} for a race")
    if len(options.runs) > 1 and (options.top or options.generations):
        raise UserError("--top and --generations are races of one run; name only that")
    if options.top and options.generations:
        raise UserError("--top and --generations are two kinds of race; name one of them")
    try:
        generations = (
            [int(part) for part in options.generations.split(",")] if options.generations else []
        )
    except ValueError:
        raise UserError(
            f"--generations {options.generations}: must be numbers with commas between them, such "
            "as 0,5,20"
        ) from None
    if len(generations) > MOST_RUNNERS:
        raise UserError(f"--generations: at most {MOST_RUNNERS} can race")
    return generations


def _backend(stage: "Stage", options: RenderOptions, wanted: str | None) -> str | None:
    """Return the GL backend to draw with, None for the painter; print the choice.

    Raises:
      UserError: GL was requested and does not work.
    """
    if options.renderer == "painter":
        return None
    from mjxgait.rendering.gl import working_backend

    backend, sentence = working_backend(stage, wanted)
    if backend is None and options.renderer == "gl":
        raise UserError(f"--renderer gl: GL does not work here, leave the option out; {sentence}")
    print(sentence)
    return backend


def _still(runners: Sequence["Runner"], stage: "Stage", options: RenderOptions) -> None:
    """Write a filmstrip of one walk, or a picture of the end of a race."""
    from mjxgait.rendering import video
    from mjxgait.rendering.filmstrip import SIZE as EACH
    from mjxgait.rendering.filmstrip import filmstrip

    if len(runners) == 1:
        picture = filmstrip(runners[0].walk, size=options.size or EACH, view=options.camera)
    else:
        picture = stage.picture(stage.frames - 1)
        video.write_captions(picture, stage, runners, stage.frames - 1)
    with writing(options.out), replaced(options.out) as beside:
        picture.save(beside)
