"""`mjxgait build`: a robot to build from a champion with a grown body."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import tyro

from mjxgait.cli.options import parsed


@dataclasses.dataclass(frozen=True)
class BuildOptions:
    """Design a robot that moves as a body of blocks does, and simulate it.

    The folder gets printable parts (STL), a bill of materials (CSV), a MuJoCo model with the masses
    and servos, and a README.md with what keeps the robot from moving as it evolved.

    Attributes:
      run: Run folder of a body of blocks that walks or jumps.
      out: New folder to write.
      length: cm of the longest side of all blocks; masses, torques and times follow from it.
      wall: mm of the printed walls.
      servos: Catalogue of servos (TOML), instead of the shipped one.
    """

    run: tyro.conf.Positional[Path]
    out: Path
    length: float = 20.0
    wall: float = 2.0
    servos: Path | None = None


def build_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(BuildOptions, "build", arguments)
    from mjxgait.api.robots import build

    build(
        options.run,
        options.out,
        length=options.length,
        wall=options.wall,
        servos=options.servos,
        tell=print,
    )
    return 0
