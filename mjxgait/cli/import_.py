"""`mjxgait import`: make a creature folder from a model file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from mjxgait.cli.options import parsed
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices
from mjxgait.importer.worker import GIGABYTES, SECONDS

Words = Annotated[tuple[str, ...], tyro.conf.UseAppendAction]


@dataclasses.dataclass(frozen=True)
class ImportOptions:
    """Make a creature folder from a model file, and report every change and guess.

    Reads MJCF, URDF, xacro, and a character's skeleton (BVH, or a skinned GLB or FBX).

    Attributes:
      model: The file; or robot:NAME, such as robot:go2, a robot of the package robot_descriptions.
      out: Folder to make.
      name: Name of the creature; by default the file's name.
      search: Further folder to search for meshes, package:// paths and includes; may be given
        several times.
      keep: Pattern of joints that stay movable although they carry no leg; may be given several
        times.
      freeze: Pattern of joints to freeze; may be given several times.
      up: Axis of the file that points up, if the guess is wrong.
      forward: Walking direction, if the guess is wrong.
      height: Height of a skeleton at rest in metres, if its unit is guessed wrong.
      seconds: Processor time that MuJoCo may use to compile the model.
      gigabytes: Memory that it may use for that.
      force: Overwrite an existing creature folder.
    """

    model: tyro.conf.Positional[Path]
    out: Path
    name: str | None = None
    search: Words = ()
    keep: Words = ()
    freeze: Words = ()
    up: Literal["x", "y", "z"] | None = None
    forward: Literal["x", "-x", "y", "-y"] | None = None
    height: float | None = None
    seconds: float = SECONDS
    gigabytes: float = GIGABYTES
    force: bool = False


def import_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    options = parsed(ImportOptions, "import", arguments)
    choices = ImportChoices(
        options.name,
        tuple(map(Path, options.search)),
        options.keep,
        options.freeze,
        options.up,
        options.forward,
        options.height,
        seconds=options.seconds,
        gigabytes=options.gigabytes,
    )
    if not (0 < options.seconds < np.inf and 0 < options.gigabytes < np.inf):
        raise UserError("--seconds and --gigabytes: give numbers above zero")
    # JAX takes a second to import.
    from mjxgait.api.bodies import into_folder
    from mjxgait.certification.feasibility import feasibility

    imported = into_folder(options.model, options.out, choices, options.force)
    print(imported.notes.text())
    print(f"wrote {options.out}; look at it with: mjxgait check {options.out}")
    for limit in feasibility(load_creature(options.out)).limits:
        print(*limit)
    if not imported.stands:
        print(
            "It does not stand by itself; it may still learn to walk, or edit the keyframe in "
            "creature.xml."
        )
    return 0
