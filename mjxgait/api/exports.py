"""The champion's walk as a file for other programs: animation, numbers, one page."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mjxgait.animation import Rate
from mjxgait.api.run import Place, Run
from mjxgait.errors import UserError
from mjxgait.files import path_of, require_ending
from mjxgait.output import Tell, silent
from mjxgait.training.folder import require_output

if TYPE_CHECKING:
    from mjxgait.animation.export import Character, WalkLoop
    from mjxgait.importer.origin import Found
    from mjxgait.rendering.walk import Walk

KINDS = (".glb", ".fbx", ".bvh", ".usda", ".usdc", ".csv", ".json")
NUMBERS = (".csv", ".json")
PAGES = (".html", ".htm")
ONTO, CAPSULES = (".glb", ".fbx"), "none"
"""Ends of a file with a character; and what is given instead of one."""


def export(
    run: Run | Place,
    out: Place,
    *,
    onto: Place | None = None,
    rate: Rate = 30,
    travelling: bool = False,
    tell: Tell = silent,
) -> Path:
    """Write the walk as a loop (GLB, FBX, BVH, USD) or as numbers (CSV, JSON); return the file.

    Does the same as `mjxgait export`.

    Args:
      out: the file; its ending chooses the format.
      onto: the character (GLB, FBX) that the creature was imported from; by default the file that
        was imported, if it is still there. "none" writes the body of capsules.
      rate: key frames per second.
      travelling: moves the root forward.
      tell: called with what was written, and with doubts about the walk.

    Raises:
      UserError: no champion, a wrong ending, FBX without a Blender, or the file cannot be written.
    """
    from mjxgait.animation.clips.fbx import require_blender
    from mjxgait.animation.export import read_character, walk_loop
    from mjxgait.animation.export.facts import examined
    from mjxgait.importer.origin import Found, find_character
    from mjxgait.rendering.video import LOOP_SECONDS, champion_of
    from mjxgait.rendering.walk import doubt

    folder, file = folder_of(run), path_of(out)
    over = None if onto is None or str(onto) == CAPSULES else path_of(onto)
    _check_names(file, over)
    require_output(file)
    require_blender(file)
    character = None if over is None else read_character(over)
    walk = champion_of(folder, LOOP_SECONDS).walk
    notes: list[str] = []
    if file.suffix.lower() in NUMBERS:
        said = _numbers(walk, file)
    else:
        loop = dataclasses.replace(walk_loop(walk, rate), certificate=examined(folder, walk))
        if file.suffix.lower() not in ONTO or over is not None:
            said = _animation(loop, character, file, travelling)
        else:
            own = find_character(walk.creature, folder)
            _check_names(file, own.file)
            said, notes = _by_itself(
                loop, Found(None) if onto is not None else own, file, travelling
            )
    for line in (f"{sized(file)}: {said}", *notes):
        tell(line)
    if doubts := doubt(folder, walk):
        tell(doubts)
    return file


def share(
    run: Run | Place,
    out: Place,
    *,
    physics: bool = False,
    wasm: Place | None = None,
    tell: Tell = silent,
) -> Path:
    """Write one offline page with the champion in 3D, or a repertoire to steer; return the file.

    Does the same as `mjxgait share`.

    Args:
      run: a run, or the folder of a repertoire.
      out: the file, ending with .html.
      physics: a page that simulates the champion instead of playing its walk.
      wasm: folder of the unpacked npm package @mujoco/mujoco, instead of npm.
      tell: called with what was written, and with doubts about the walk.

    Raises:
      UserError: no champion, a wrong ending, no WebAssembly build, or the file cannot be written.
    """
    folder, file = folder_of(run), path_of(out)
    require_ending(file, PAGES)
    if wasm and not physics:
        raise UserError(
            "--wasm names what --physics puts into the page; add --physics, or leave it out"
        )
    require_output(file)
    doubts = _write_page(folder, file, physics, path_of(wasm) if wasm else None)
    tell(sized(file))
    if doubts:
        tell(doubts)
    return file


def _write_page(folder: Path, file: Path, physics: bool, wasm: Path | None) -> str:
    """Write the page; return doubts about the walk, or nothing."""
    from mjxgait.experiments.repertoire.clips import write_driven
    from mjxgait.experiments.repertoire.grid import GRID
    from mjxgait.web.page import write_page
    from mjxgait.web.physics import write_physics_page

    repertoire = (folder / GRID).is_file()
    if physics and repertoire:
        raise UserError(
            f"{folder}: a repertoire; its page plays animation. Name one of its runs for --physics"
        )
    if physics:
        return write_physics_page(folder, file, wasm)
    if repertoire:
        write_driven(folder, file)
        return ""
    return write_page(folder, file)


def plot(
    run: Run | Place, out: Place | None = None, formats: Sequence[str] = ("png", "svg")
) -> list[Path]:
    """Draw all plots of a run, and return their files.

    Does the same as `mjxgait plot`. out: a folder; by default RUN/plots.

    Raises:
      UserError: no run, or the folder cannot be written.
    """
    from mjxgait.rendering.plots import plot_run

    return plot_run(folder_of(run), None if out is None else path_of(out), formats)


def sized(file: Path) -> str:
    """Return a file with its size in words."""
    return f"{file} ({file.stat().st_size / 1024:,.0f} KiB)"


def folder_of(run: Run | Place) -> Path:
    """Return the folder of a run."""
    return run.folder if isinstance(run, Run) else path_of(run)


def _numbers(walk: "Walk", out: Path) -> str:
    """Write the walk as numbers; return what was written."""
    from mjxgait.animation.export.motion import export_motion

    export_motion(walk, out)
    return f"{walk.seconds:.2f} s at {1 / walk.time_step:.0f} Hz"


def _animation(loop: "WalkLoop", character: "Character | None", out: Path, travelling: bool) -> str:
    """Write the loop; return what was written."""
    called = _write(loop, character, out, travelling)
    seconds, rate, speed = loop.times[-1], loop.rate, loop.speed
    if not loop.strides:
        return f"{called}a contest of {seconds:.2f} s at {rate} frames/s"
    strides = "1 stride" if loop.strides == 1 else f"{loop.strides} strides"
    return f"{called}{strides}, {seconds:.2f} s at {rate} frames/s, {speed:.2f} m/s"


def _by_itself(
    loop: "WalkLoop", own: "Found", out: Path, travelling: bool
) -> tuple[str, list[str]]:
    """Write the loop onto the creature's own character, or else its body of capsules.

    Return what was written, and notes: a walk that does not fit its character is written all the
    same, because no file was given.
    """
    from mjxgait.animation.export import read_character

    notes = [f"{out}: {own.note}"] if own.note and own.file is None else []
    if own.file is not None:
        try:
            said = _animation(loop, read_character(own.file), out, travelling)
        except UserError as error:
            notes = [f"{out}: shows the body of capsules, because {error}"]
        else:
            where = f"on your character {own.file}; --onto {CAPSULES} writes the body of capsules"
            return said, [f"{out}: {where}", *([own.note] if own.note else [])]
    return _animation(loop, None, out, travelling), notes


def _check_names(out: Path, onto: Path | None) -> None:
    """Refuse a kind of file that is not written, and to write over the character."""
    require_ending(out, KINDS)
    kind = out.suffix.lower()
    if onto is None:
        return
    if kind not in ONTO:
        ends = " or ".join(ONTO)
        raise UserError(f"{out}: with --onto a character is written; end the name with {ends}")
    if out.exists() and onto.exists() and out.samefile(onto):
        raise UserError(f"{out}: is your character, which stays; name another file with --out")


def _write(loop: "WalkLoop", character: "Character | None", out: Path, travelling: bool) -> str:
    """Write the file; return words about the animation on a character."""
    from mjxgait.animation.export import export_bvh, export_glb, export_onto, export_usd

    if character is not None:
        return f'animation "{export_onto(loop, character, out, travelling)}", '
    writers = {**dict.fromkeys(ONTO, export_glb), ".bvh": export_bvh}
    writers.get(out.suffix.lower(), export_usd)(loop, out, travelling)
    return ""
