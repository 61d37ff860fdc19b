"""`mjxgait export`: the champion's walk as an animation file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import tyro

from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True)
class ExportOptions:
    """Write the champion's walk as a seamless loop: a skinned GLB or USD, or a BVH skeleton.

    Units m, Y up, forward +Z.

    Attributes:
      run: Run folder.
      out: File to write, ending with .glb, .bvh, .usda or .usdc.
      rate: Key frames per second.
      travelling: Move the root forward; otherwise the creature walks in place.
    """

    run: tyro.conf.Positional[Path]
    out: Path
    rate: Literal[24, 30, 60] = 30
    travelling: bool = False


def export_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = tyro.cli(ExportOptions, args=list(arguments), prog="mjxgait export")
    from mjxgait.animation.export import (
        export_bvh,
        export_glb,
        export_usd,
        walk_loop,
    )
    from mjxgait.rendering.video import LOOP_SECONDS, champion_of
    from mjxgait.rendering.walk import doubt
    from mjxgait.training.stored import require_writable

    writers = {".glb": export_glb, ".bvh": export_bvh, ".usda": export_usd, ".usdc": export_usd}
    if (kind := options.out.suffix.lower()) not in writers:
        raise UserError(
            f'{options.out}: cannot write "{options.out.suffix}"; end the name with '
            f"{', '.join(writers)}"
        )
    require_writable(options.out)
    walk = champion_of(options.run, LOOP_SECONDS).walk
    loop = walk_loop(walk, options.rate)
    writers[kind](loop, options.out, options.travelling)
    size = options.out.stat().st_size / 1024
    strides = "1 stride" if loop.strides == 1 else f"{loop.strides} strides"
    print(
        f"{options.out} ({size:,.0f} KiB): {strides}, {loop.times[-1]:.2f} s at {loop.rate} "
        f"frames/s, {loop.speed:.2f} m/s"
    )
    if said := doubt(options.run, walk):
        print(said)
    return 0
