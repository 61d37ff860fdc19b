"""Videos of one champion, or several walks as a race, as WebP, GIF, MP4, MOV or WebM."""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
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


@dataclasses.dataclass(frozen=True)
class Coding:
    """How PyAV writes a kind of file. opaque, clear: pixel formats without and with alpha; an empty
    one if it has no alpha.
    """

    codec: str
    opaque: str
    clear: str
    options: Mapping[str, str]


CODINGS = {
    ".mp4": Coding("libx264", "yuv420p", "", {"crf": "20"}),
    # ProRes 4444, which editors read; VP9 with alpha, which browsers play.
    ".mov": Coding("prores_ks", "yuv444p10le", "yuva444p10le", {"profile": "4444"}),
    ".webm": Coding(
        "libvpx-vp9",
        "yuv420p",
        "yuva420p",
        {"crf": "28", "b": "0", "cpu-used": "4", "row-mt": "1"},
    ),
}
VIDEOS = (".webp", ".gif", *CODINGS)
STILL = ".png"
PAPER = (255, 255, 255, 200)
LABEL_GAP = 8
"""Pixels between a creature and its label."""
EDGE = 8
"""Pixels between a label and the picture's edge."""
WEBP_UNIT, GIF_UNIT = 1, 10
"""Units in which a frame's duration is stored, ms."""
GIF_FASTEST = 50
"""Frames per second; programs show a GIF's frames of 10 ms for 100 ms."""
NTSC = 0.005
"""Largest distance of a given frame rate from one of NTSC, such as 23.98 from 24000/1001."""
GIF_COLOURS = 128
"""Colours of a GIF; in a transparent one the last stands for none."""
OPAQUE = 128
"""Least alpha of a pixel that a GIF shows: it has whole pixels only."""


@dataclasses.dataclass(frozen=True, eq=False)
class Runner:
    """A walk and its label, which is empty for a single walk."""

    walk: Walk
    label: str = ""


def moving_pictures(
    runners: Sequence[Runner],
    stage: Stage,
    fps: float,
    slow: float = 1.0,
    backend: str | None = None,
) -> Iterator[Image.Image]:
    """Draw the frames of a video; nothing is written on a transparent background.

    slow: factor by which time is stretched. backend: of GL; None draws without.
    """
    step = stage.time_step
    count = max(int(stage.frames * step * slow * fps), 1)
    frames = [min(round(i / fps / slow / step), stage.frames - 1) for i in range(count)]
    pictures = gl_pictures(stage, frames, backend) if backend else stage.pictures(frames)
    for frame, picture in zip(frames, pictures, strict=True):
        if not stage.around.clear:
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


def write_video(pictures: Iterable[Image.Image], path: Path, fps: float) -> None:
    """Write the frames, RGB or RGBA, in the format given by the file's suffix.

    Raises:
      UserError: another format, one without its extra, or a file that cannot be written.
    """
    require_ending(path, VIDEOS)
    kind = path.suffix.lower()
    write = {".webp": _write_webp, ".gif": _write_gif}.get(kind, _write_coded)
    with writing(path), replaced(path) as beside:
        write(pictures, beside, fps)


def require_writer(path: Path, stills: bool = False, fps: float = 1.0, clear: bool = False) -> None:
    """Check before the long work that the file can be written.

    stills: whether a picture will do as well as a video. clear: whether it needs transparency.

    Raises:
      UserError: see `write_video`; or the format cannot hold the frame rate or transparency.
    """
    require_ending(path, (*VIDEOS, STILL) if stills else VIDEOS)
    kind = path.suffix.lower()
    if kind == ".gif" and fps > GIF_FASTEST:
        raise UserError(
            f"{path}: a GIF holds at most {GIF_FASTEST} frames per second; lower --fps, or write "
            ".webp or .mp4"
        )
    if clear and kind in CODINGS and not CODINGS[kind].clear:
        raise UserError(
            f"{path}: {kind[1:].upper()} holds no transparency; end the name with .webp, .mov, "
            ".webm, .gif or .png, or leave --background out"
        )
    if kind in CODINGS:
        _import_av(path)
    require_output(path)


def frame_rate(fps: float) -> Fraction:
    """Return the exact frame rate: 23.976, 29.97 and the like are those of NTSC, n / 1.001."""
    whole = round(1.001 * fps)
    if fps != round(fps) and abs(fps - whole / 1.001) < NTSC:
        return Fraction(1000 * whole, 1001)
    return Fraction(fps).limit_denominator(1000)


def durations(count: int, fps: float, unit: int) -> list[int]:
    """Return the durations [count] of frames in ms, whole units that add up to the right length."""
    ends = np.round(np.arange(count + 1) * (1000 / unit / float(frame_rate(fps))))
    return [int(duration) for duration in unit * np.diff(ends)]


def _write_webp(pictures: Iterable[Image.Image], path: Path, fps: float) -> None:
    first, *others = pictures
    first.save(
        path,
        save_all=True,
        append_images=others,
        duration=durations(1 + len(others), fps, WEBP_UNIT),
        loop=0,
        quality=75,
        method=3,
    )


def _write_gif(given: Iterable[Image.Image], path: Path, fps: float) -> None:
    pictures = list(given)
    clear = pictures[0].mode == "RGBA"
    # One palette for all frames, so that still parts do not flicker.
    samples = [sample.convert("RGB") for sample in pictures[:: max(len(pictures) // 6, 1)]]
    joined = Image.fromarray(np.concatenate([np.asarray(sample) for sample in samples]))
    colours = joined.quantize(GIF_COLOURS - clear, method=Image.Quantize.MEDIANCUT)
    frames = []
    for picture in pictures:
        frame = picture.convert("RGB").quantize(palette=colours, dither=Image.Dither.NONE)
        if clear:
            frame.paste(GIF_COLOURS - 1, mask=picture.getchannel("A").point(_hidden))
            frame.info["transparency"] = GIF_COLOURS - 1
        frames.append(frame)
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=durations(len(frames), fps, GIF_UNIT),
        loop=0,
        optimize=False,
        # Else clear pixels would show the frame before.
        disposal=2 if clear else 0,
    )


def _hidden(alpha: int) -> int:
    return 0 if alpha >= OPAQUE else 255


def _write_coded(pictures: Iterable[Image.Image], path: Path, fps: float) -> None:
    av, coding = _import_av(path), CODINGS[path.suffix.lower()]
    frames = iter(pictures)
    first = next(frames)
    # Half the colours of a line or a column cannot be stored.
    width, height = first.width // 2 * 2, first.height // 2 * 2
    form = "rgba" if first.mode == "RGBA" else "rgb24"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(coding.codec, rate=frame_rate(fps))
        stream.width, stream.height, stream.options = width, height, dict(coding.options)
        stream.pix_fmt = coding.clear if first.mode == "RGBA" else coding.opaque
        for picture in itertools.chain([first], frames):
            pixels = np.ascontiguousarray(np.asarray(picture)[:height, :width])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format=form)))
        container.mux(stream.encode())


def _import_av(path: Path) -> ModuleType:
    try:
        import av
    except ImportError:
        raise UserError(
            f"{path}: {path.suffix[1:].upper()} needs an extra: {install_command('video')}; WebP "
            "and GIF need none"
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
