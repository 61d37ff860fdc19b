"""Videos of one champion, or several walks as a race, as WebP, GIF or MP4."""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
from PIL import Image, ImageDraw

from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.files import replaced, require_ending, writing
from mjxgait.rendering.floor import DARK_INK, font
from mjxgait.rendering.gl import gl_pictures
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import Walk, record_walk
from mjxgait.training.folder import open_champion, require_output

VIDEOS = (".webp", ".gif", ".mp4")
STILL = ".png"
PAPER = (255, 255, 255, 200)
LABEL_GAP = 8
"""Pixels between a creature and its label."""
EDGE = 8
"""Pixels between a label and the picture's edge."""
GIF_HUNDREDTHS = 100
"""Time units per second in a GIF."""


@dataclasses.dataclass(frozen=True, eq=False)
class Runner:
    """A walk and its label, which is empty for a single walk."""

    walk: Walk
    label: str = ""


def moving_pictures(
    runners: Sequence[Runner], stage: Stage, fps: int, slow: float = 1.0, backend: str | None = None
) -> Iterator[Image.Image]:
    """Draw the frames of a video.

    slow: factor by which time is stretched. backend: of GL; None draws without.
    """
    step = stage.time_step
    count = max(int(stage.frames * step * slow * fps), 1)
    frames = [min(round(i / fps / slow / step), stage.frames - 1) for i in range(count)]
    pictures = gl_pictures(stage, frames, backend) if backend else stage.pictures(frames)
    for frame, picture in zip(frames, pictures, strict=True):
        write_captions(picture, stage, runners, frame, slow)
        yield picture


def write_captions(
    picture: Image.Image, stage: Stage, runners: Sequence[Runner], frame: int, slow: float = 1.0
) -> None:
    """Write name, speed and time; in a race label every walk."""
    draw = ImageDraw.Draw(picture, "RGBA")
    size, now = max(stage.height // 20, 13), frame * stage.time_step
    lead = runners[0].walk
    if len({runner.walk.creature.name for runner in runners}) == 1:
        draw.text((12, 10), lead.creature.title, fill=DARK_INK, font=font(size))
    time = f"{now:.1f} s" + (f"  (slowed {slow:g} times)" if slow != 1 else "")
    draw.text((stage.width - 12, 10), time, fill=DARK_INK, font=font(size), anchor="ra")
    if len(runners) == 1:
        draw.text(
            (12, 14 + size), condition(lead, now), fill=DARK_INK, font=font(round(0.8 * size))
        )
        return
    for place, runner in reversed(list(enumerate(runners))):
        x, y = stage.behind(frame, place) - [LABEL_GAP, 0]
        text = f"{runner.label}: {condition(runner.walk, now)}"
        letters = font(round(0.7 * size))
        box = draw.textbbox((x, y), text, font=letters, anchor="rm")
        # A walk that was left behind keeps its label at the edge.
        x += max(EDGE - box[0], 0) + min(stage.width - EDGE - box[2], 0)
        y += max(EDGE - box[1], 0) + min(stage.height - EDGE - box[3], 0)
        left, top, right, bottom = draw.textbbox((x, y), text, font=letters, anchor="rm")
        draw.rectangle((left - 4, top - 3, right + 4, bottom + 3), fill=PAPER)
        draw.text((x, y), text, fill=DARK_INK, font=letters, anchor="rm")


def condition(walk: Walk, time: float) -> str:
    """Return the mean forward speed of the last second, or the time of a fall. time: s."""
    if time >= walk.fell:
        return f"fell at {walk.fell:.1f} s"
    frame = min(round(time / walk.time_step), len(walk.qpos) - 1)
    before = max(frame - round(1.0 / walk.time_step), 0)
    if frame == before:
        return "0.00 m/s"
    moved = walk.trunk_pos[frame] - walk.trunk_pos[before]
    # In water there is no level way.
    way = np.linalg.norm(moved) if walk.afloat else moved[:2] @ walk.forward
    return f"{way / ((frame - before) * walk.time_step):.2f} m/s"


def write_video(pictures: Iterable[Image.Image], path: Path, fps: int) -> None:
    """Write the frames in the format given by the file's suffix.

    Raises:
      UserError: another format, MP4 without the extra, or a file that cannot be written.
    """
    require_ending(path, VIDEOS)
    writers = {".mp4": _write_mp4, ".webp": _write_webp, ".gif": _write_gif}
    write = writers[path.suffix.lower()]
    with writing(path), replaced(path) as beside:
        write(pictures, beside, fps)


def require_writer(path: Path, stills: bool = False) -> None:
    """Check before the long work that the file can be written.

    stills: whether a picture will do as well as a video.

    Raises:
      UserError: see `write_video`.
    """
    require_ending(path, (*VIDEOS, STILL) if stills else VIDEOS)
    if path.suffix.lower() == ".mp4":
        _import_av(path)
    require_output(path)


def _write_webp(pictures: Iterable[Image.Image], path: Path, fps: int) -> None:
    first, *others = pictures
    first.save(
        path,
        save_all=True,
        append_images=others,
        duration=round(1000 / fps),
        loop=0,
        quality=75,
        method=3,
    )


def _write_gif(given: Iterable[Image.Image], path: Path, fps: int) -> None:
    pictures = list(given)
    # One palette for all frames, so that still parts do not flicker.
    samples = pictures[:: max(len(pictures) // 6, 1)]
    joined = Image.fromarray(np.concatenate([np.asarray(sample) for sample in samples]))
    palette = joined.quantize(128, method=Image.Quantize.MEDIANCUT)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    duration = 10 * max(round(GIF_HUNDREDTHS / fps), 2)
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=duration, loop=0, optimize=False
    )


def _write_mp4(pictures: Iterable[Image.Image], path: Path, fps: int) -> None:
    av = _import_av(path)
    frames = iter(pictures)
    first = next(frames)
    # H.264 requires even sizes.
    width, height = first.width // 2 * 2, first.height // 2 * 2
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=fps)
        stream.width, stream.height, stream.pix_fmt, stream.options = (
            width,
            height,
            "yuv420p",
            {"crf": "20"},
        )
        for picture in itertools.chain([first], frames):
            container.mux(
                stream.encode(av.VideoFrame.from_image(picture.crop((0, 0, width, height))))
            )
        container.mux(stream.encode())


def _import_av(path: Path) -> ModuleType:
    try:
        import av
    except ImportError:
        raise UserError(
            f"{path}: MP4 needs an extra: {install_command('video')}; WebP and GIF need none"
        ) from None
    return av


LOOP_SECONDS = 12.0
"""Simulated time to find a steady stride; shared, so that all outputs show the same stride."""


def champion_of(run: Path, seconds: float) -> Runner:
    """Return the run's champion."""
    return Runner(record_walk(*open_champion(run), seconds))


def champions_of(runs: Sequence[Path], seconds: float) -> list[Runner]:
    """Return each run's champion, labelled by creature, or by folder if creatures repeat."""
    walks = [champion_of(run, seconds).walk for run in runs]
    names = [walk.creature.title for walk in walks]
    for others in ([run.resolve().name for run in runs], [str(run) for run in runs]):
        names = names if len(set(names)) == len(names) else others
    return [Runner(walk, name) for walk, name in zip(walks, names, strict=True)]


def top_of(run: Path, count: int, seconds: float) -> list[Runner]:
    """Return the best of the latest population, best first.

    Raises:
      UserError: the population is smaller.
    """
    return [
        Runner(walk, f"rank {rank}")
        for rank, walk in _walks(run, None, range(1, count + 1), seconds)
    ]


def through_generations(run: Path, generations: Sequence[int], seconds: float) -> list[Runner]:
    """Return the best of each of these generations.

    Raises:
      UserError: there is no checkpoint of one of them.
    """
    return in_generations(run, dict.fromkeys(generations, 0), seconds)


def in_generations(run: Path, places: Mapping[int, int], seconds: float) -> list[Runner]:
    """Return one individual per generation, given by its place; 0 is the best.

    Raises:
      UserError: there is no checkpoint of one of them.
    """
    return [
        Runner(walk, f"generation {generation}")
        for generation, place in places.items()
        for _, walk in _walks(run, generation, range(place + 1, place + 2), seconds)
    ]


def _walks(
    run: Path, generation: int | None, ranks: range, seconds: float
) -> Iterator[tuple[int, Walk]]:
    from mjxgait.inspect.snapshot import read_snapshot

    snapshot = read_snapshot(run, generation)
    for rank, champion in [(rank, snapshot.champion(rank)) for rank in ranks]:
        yield rank, record_walk(champion.embodied(snapshot.creature), champion, seconds)
