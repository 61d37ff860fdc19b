"""`mjxgait share`: an offline page of a run's champion, recorded or simulated, or a repertoire."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.cli.options import parsed


@dataclasses.dataclass(frozen=True)
class ShareOptions:
    """Write one HTML file with the 3D walk, the curves and the certificate.

    It plays by double click, without a network. The page of a repertoire is steered with arrow keys
    or a stick.

    Attributes:
      run: Run folder, or the folder of a repertoire.
      out: File to write, ending with .html.
      physics: A page that simulates the champion instead of playing its walk: pull it, push it,
        tilt the floor. For key poses, expressions, networks and brains. It contains MuJoCo's WebAssembly
        build, which npm fetches once.
      wasm: Folder of the unpacked npm package @mujoco/mujoco, instead of npm.
    """

    run: tyro.conf.Positional[Path]
    out: Path
    physics: bool = False
    wasm: Path | None = None


def share_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(ShareOptions, "share", arguments)
    from mjxgait.api.exports import share

    share(options.run, options.out, physics=options.physics, wasm=options.wasm, tell=print)
    return 0
