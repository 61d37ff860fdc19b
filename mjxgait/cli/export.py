"""`mjxgait export`: the champion's walk as an animation file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from mjxgait.errors import UserError

if TYPE_CHECKING:
    from mjxgait.animation.export import Character, WalkLoop

KINDS = (".glb", ".bvh", ".usda", ".usdc")


@dataclasses.dataclass(frozen=True)
class ExportOptions:
    """Write the champion's walk as a seamless loop: a skinned GLB or USD, or a BVH skeleton.

    Units m, Y up, forward +Z.

    Attributes:
      run: Run folder.
      out: File to write, ending with .glb, .bvh, .usda or .usdc.
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
    options = tyro.cli(ExportOptions, args=list(arguments), prog="mjxgait export")
    from mjxgait.animation.export import read_character, walk_loop
    from mjxgait.rendering.video import LOOP_SECONDS, champion_of
    from mjxgait.rendering.walk import doubt
    from mjxgait.training.stored import require_writable

    _check_names(options.out, options.onto)
    require_writable(options.out)
    character = None if options.onto is None else read_character(options.onto)
    walk = champion_of(options.run, LOOP_SECONDS).walk
    loop = walk_loop(walk, options.rate)
    called = _write(loop, character, options.out, options.travelling)
    size = options.out.stat().st_size / 1024
    strides = "1 stride" if loop.strides == 1 else f"{loop.strides} strides"
    print(
        f"{options.out} ({size:,.0f} KiB): {called}{strides}, {loop.times[-1]:.2f} s at {loop.rate} "
        f"frames/s, {loop.speed:.2f} m/s"
    )
    if said := doubt(options.run, walk):
        print(said)
    return 0


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
