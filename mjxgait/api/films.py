"""Videos, filmstrips and races."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from mjxgait.api.exports import folder_of, sized
from mjxgait.api.run import Place, Run, runs_of
from mjxgait.errors import UserError
from mjxgait.files import path_of, replaced, writing
from mjxgait.output import Tell, silent

if TYPE_CHECKING:
    from mjxgait.rendering.stage import Stage
    from mjxgait.rendering.video import Runner

MOST_RUNNERS = 12
SIZE = (1280, 720)
"""Pixels of a video, and of a race's still."""
FPS = 25.0
SLOWEST, FASTEST = 1, 240
"""Limits of the frames per second."""
SECONDS = 5.0
"""Length of a video."""
Camera = Literal["side", "front", "top", "three-quarter", "follow"]
Renderer = Literal["auto", "painter", "gl"]
Background = Literal["scene", "transparent"]


@dataclasses.dataclass(frozen=True)
class Film:
    """What to film; see `render`."""

    runs: tuple[Path, ...]
    out: Path
    top: int | None = None
    generations: str | None = None
    seconds: float | None = None
    fps: float = FPS
    size: tuple[int, int] | None = None
    camera: Camera | None = None
    slow: float = 1.0
    renderer: Renderer = "auto"
    background: Background = "scene"


def render(
    run: Run | Place | Sequence[Run | Place],
    out: Place,
    *,
    top: int | None = None,
    generations: Sequence[int] | None = None,
    seconds: float | None = None,
    fps: float = FPS,
    size: tuple[int, int] | None = None,
    camera: Camera | None = None,
    slow: float = 1.0,
    renderer: Renderer = "auto",
    background: Background = "scene",
    tell: Tell = silent,
) -> Path:
    """Make a video or a filmstrip of a champion, or a race of several; return the file.

    Does the same as `mjxgait render`.

    Args:
      run: a run, or several for a race.
      out: the file: .webp, .gif, .mp4, .mov or .webm (these three: extra [video]), or .png for a
        filmstrip.
      top: a race of the best so many of the latest population.
      generations: a race of the best of these generations.
      seconds: length of the walk.
      fps: frames per second, 1 to 240, such as 23.976; a .gif holds up to 50.
      size: width and height in pixels.
      camera: position of the camera.
      slow: slow-motion factor.
      renderer: auto and painter draw without GL; gl is MuJoCo's own renderer.
      background: transparent shows only the bodies and their shadow; not for .mp4, nor by gl.
      tell: called with the GL backend, the file's size, and doubts about a walk.

    Raises:
      UserError: no champion, an invalid argument, or the file cannot be written.
    """
    film = Film(
        runs=tuple(map(folder_of, runs_of(run))),
        out=path_of(out),
        top=top,
        generations=",".join(map(str, generations)) if generations else None,
        seconds=seconds,
        fps=fps,
        size=size,
        camera=camera,
        slow=slow,
        renderer=renderer,
        background=background,
    )
    write_film(film, os.environ.get("MUJOCO_GL"), tell)
    return film.out


def write_film(film: Film, wanted: str | None, tell: Tell) -> None:
    """Write a film. wanted: value of MUJOCO_GL.

    Raises:
      UserError: see `render`.
    """
    from mjxgait.rendering import video
    from mjxgait.rendering.stage import Stage
    from mjxgait.rendering.walk import doubt

    generations = _check(film)
    clear = film.background == "transparent"
    video.require_writer(film.out, stills=True, fps=film.fps, clear=clear)
    still = film.out.suffix.lower() == video.STILL
    alone = not (film.top or generations or len(film.runs) > 1)
    seconds = film.seconds or (video.LOOP_SECONDS if still and alone else SECONDS)
    if alone:
        runners = [video.champion_of(film.runs[0], seconds)]
    elif film.top:
        runners = video.top_of(film.runs[0], film.top, seconds)
    elif generations:
        runners = video.through_generations(film.runs[0], generations, seconds)
    else:
        runners = video.champions_of(film.runs, seconds)
    walks = [runner.walk for runner in runners]
    stage = Stage(walks, *(film.size or SIZE), film.camera, clear)
    if still:
        _still(runners, stage, film)
    else:
        backend = _backend(stage, film, wanted, tell)
        video.write_video(
            video.moving_pictures(runners, stage, film.fps, film.slow, backend),
            film.out,
            film.fps,
        )
    tell(sized(film.out))
    if not (film.top or generations):
        for run, runner in zip(film.runs, runners, strict=True):
            if said := doubt(run, runner.walk):
                tell(f"{runner.label}: {said}" if runner.label else said)


def _check(film: Film) -> list[int]:
    """Check a film, and return the requested generations.

    Raises:
      UserError: an invalid option, by name.
    """
    for name, value, low, high in (
        ("fps", film.fps, SLOWEST, FASTEST),
        ("seconds", SECONDS if film.seconds is None else film.seconds, 0.1, 600),
        ("slow", film.slow, 0.1, 100),
        ("size", min(film.size or SIZE), 64, 4096),
        ("size", max(film.size or SIZE), 64, 4096),
        ("top", 1 if film.top is None else film.top, 1, MOST_RUNNERS),
    ):
        if not low <= value <= high:
            raise UserError(f"--{name} {value:.10g}: must lie between {low} and {high}")
    if not 1 <= len(film.runs) <= MOST_RUNNERS:
        raise UserError(f"name a run folder, or up to {MOST_RUNNERS} for a race")
    if len(film.runs) > 1 and (film.top or film.generations):
        raise UserError("--top and --generations are races of one run; name only that")
    if film.renderer == "gl" and film.background == "transparent":
        raise UserError("--renderer gl draws no transparent background; leave out one of the two")
    if film.top and film.generations:
        raise UserError("--top and --generations are two kinds of race; name one of them")
    text = film.generations
    try:
        generations = [] if text is None else [int(part) for part in text.split(",")]
    except ValueError:
        raise UserError(
            f"--generations {text}: must be numbers with commas between them, such as 0,5,20"
        ) from None
    if len(generations) > MOST_RUNNERS:
        raise UserError(f"--generations: at most {MOST_RUNNERS} can race")
    return generations


def _backend(stage: "Stage", film: Film, wanted: str | None, tell: Tell) -> str | None:
    """Return the GL backend to draw with, and tell it; None for the painter.

    Raises:
      UserError: GL was requested and does not work.
    """
    if film.renderer != "gl":
        return None
    from mjxgait.rendering.gl import working_backend

    backend, sentence = working_backend(stage, wanted)
    if backend is None:
        raise UserError(f"--renderer gl: {sentence}; leave the option out")
    tell(sentence)
    return backend


def _still(runners: Sequence["Runner"], stage: "Stage", film: Film) -> None:
    """Write a filmstrip of one walk, or a picture of the end of a race."""
    from mjxgait.rendering import video
    from mjxgait.rendering.filmstrip import SIZE as EACH
    from mjxgait.rendering.filmstrip import filmstrip

    if len(runners) == 1:
        walk, size = runners[0].walk, film.size or EACH
        picture = filmstrip(walk, size=size, view=film.camera, clear=stage.clear)
    else:
        picture = stage.picture(stage.frames - 1)
        if not stage.clear:
            video.write_captions(picture, stage, runners, stage.frames - 1)
    with writing(film.out), replaced(film.out) as beside:
        picture.save(beside)
