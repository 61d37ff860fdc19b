"""`mjxgait export`: the champion's walk as an animation file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from mjxgait.cli.options import parsed
from mjxgait.errors import UserError

if TYPE_CHECKING:
    from mjxgait.animation.export import Character, WalkLoop
    from mjxgait.rendering.walk import Walk

KINDS = (".glb", ".bvh", ".usda", ".usdc", ".csv", ".json")
NUMBERS = (".csv", ".json")


@dataclasses.dataclass(frozen=True)
class ExportOptions:
    """Write the champion's walk as a seamless loop: a skinned GLB or USD, or a BVH skeleton.

    Units m, Y up, forward +Z. Or write all of it as numbers for a robot, Z up: base, joints,
    targets, torques and contacts at every control step (docs/guide/seeing.md).

    Attributes:
      run: Run folder.
      out: File to write, ending with .glb, .bvh, .usda or .usdc; .csv or .json for
        numbers.
      onto: The character (GLB) that the creature was imported from; the file gets the walk as one
        more animation of it, in its own axes and units.
      rate: Key frames per second.
      travelling: Move the root forward; otherwise the creature walks in place.
    """

    run: tyro.conf.Positional[Path]
    out: Path
    onto: Path | None = None
    rate: Literal[24, 30, 60] = 30
    travelling: bool = False


def export_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(ExportOptions, "export", arguments)
    from mjxgait.animation.export import read_character, walk_loop
    from mjxgait.rendering.video import LOOP_SECONDS, champion_of
    from mjxgait.rendering.walk import doubt
    from mjxgait.training.stored import require_writable

    _check_names(options.out, options.onto)
    require_writable(options.out)
    character = None if options.onto is None else read_character(options.onto)
    walk = champion_of(options.run, LOOP_SECONDS).walk
    said = (
        _numbers(walk, options.out)
        if options.out.suffix.lower() in NUMBERS
        else _animation(walk_loop(walk, options.rate), character, options.out, options.travelling)
    )
    print(f"{options.out} ({options.out.stat().st_size / 1024:,.0f} KiB): {said}")
    if said := doubt(options.run, walk):
        print(said)
    return 0


def _numbers(walk: "Walk", out: Path) -> str:
    """Write the walk as numbers; return what was written."""
    from mjxgait.animation.export.motion import export_motion

    export_motion(walk, out)
    return f"{walk.seconds:.2f} s at {1 / walk.time_step:.0f} Hz"


def _animation(loop: "WalkLoop", character: "Character | None", out: Path, travelling: bool) -> str:
    """Write the loop; return what was written."""
    called = _write(loop, character, out, travelling)
    strides = "1 stride" if loop.strides == 1 else f"{loop.strides} strides"
    seconds, rate, speed = loop.times[-1], loop.rate, loop.speed
    return f"{called}{strides}, {seconds:.2f} s at {rate} frames/s, {speed:.2f} m/s"


def _check_names(out: Path, onto: Path | None) -> None:
    """Refuse a kind of file that is not written, and to write over the character."""
    if (kind := out.suffix.lower()) not in KINDS:
        raise UserError(f'{out}: cannot write "{out.suffix}"; end the name with {", ".join(KINDS)}')
    if onto is None:
        return
    if kind != ".glb":
        raise UserError(f"{out}: with --onto a character is written; end the name with .glb")
    if out.exists() and onto.exists() and out.samefile(onto):
        raise UserError(f"{out}: is your character, which stays; name another file with --out")


def _write(loop: "WalkLoop", character: "Character | None", out: Path, travelling: bool) -> str:
    """Write the file; return words about the animation on a character."""
    from mjxgait.animation.export import export_bvh, export_glb, export_onto, export_usd

    if character is not None:
        return f'animation "{export_onto(loop, character, out, travelling)}", '
    writers = {".glb": export_glb, ".bvh": export_bvh}
    writers.get(out.suffix.lower(), export_usd)(loop, out, travelling)
    return ""
