"""`mjxgait export`: the champion's walk as an animation file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.animation import Rate
from mjxgait.cli.options import parsed


@dataclasses.dataclass(frozen=True)
class ExportOptions:
    """Write the champion's walk as a seamless loop: a skinned GLB, FBX or USD, or a BVH skeleton.

    Units m, Y up, forward +Z. Or write all of it as numbers for a robot, Z up: base, joints,
    targets, torques and contacts at every control step (docs/guide/seeing.md).

    Attributes:
      run: Run folder.
      out: File to write, ending with .glb, .fbx (by Blender), .bvh, .usda or .usdc; .csv or .json
        for numbers.
      onto: The character (GLB, FBX) that the creature was imported from; the file gets the walk as
        one more animation of it, in its own axes and units. By default the file that was imported,
        if it is still there; "none" writes the body of capsules.
      rate: Key frames per second.
      travelling: Move the root forward; otherwise the creature walks in place.
    """

    run: tyro.conf.Positional[Path]
    out: Path
    onto: Path | None = None
    rate: Rate = 30
    travelling: bool = False


def export_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(ExportOptions, "export", arguments)
    from mjxgait.api.exports import export

    export(
        options.run,
        options.out,
        onto=options.onto,
        rate=options.rate,
        travelling=options.travelling,
        tell=print,
    )
    return 0
