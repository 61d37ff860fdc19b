"""`mjxgait import`: make a creature folder from a model file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from mjxgait.cli.options import parsed
from mjxgait.creature.scale import load_files
from mjxgait.errors import UserError
from mjxgait.files import write_text, writing
from mjxgait.importer import (
    TOML,
    WRITTEN,
    ImportChoices,
    Imported,
    import_model,
)
from mjxgait.importer.worker import GIGABYTES, SECONDS

Words = Annotated[tuple[str, ...], tyro.conf.UseAppendAction]


@dataclasses.dataclass(frozen=True)
class ImportOptions:
    """Make a creature folder from a model file, and report every change and guess.

    Reads MJCF, URDF, and a character's skeleton (BVH, or a skinned GLB).

    Attributes:
      model: The file.
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
    check_folder(options.out, choices.search, options.model, options.force)
    imported = import_model(options.model, choices)
    write_folder(options.out, imported)
    print(imported.notes.text())
    print(f"wrote {options.out}; look at it with: mjxgait check {options.out}")
    if not imported.stands:
        print(
            "It does not stand by itself; it may still learn to walk, or edit the keyframe in "
            "creature.xml."
        )
    return 0


def check_folder(folder: Path, read: Sequence[Path], model: Path, force: bool) -> None:
    """Check, before the slow import, that a creature may be written to the folder.

    Args:
      read: folders that the import reads besides the model's own. force: overwrite a creature.

    Raises:
      UserError: the import reads from the folder, or it contains other things than a creature, or
        a creature without `force`.
    """
    if folder.resolve() in {place.resolve() for place in (model.parent, *read)}:
        raise UserError(
            f"{folder}: the import reads from this folder, so it writes nothing there; name another "
            "with --out"
        )
    if not folder.exists():
        return
    names = {file.name for file in folder.iterdir()} if folder.is_dir() else {"a file"}
    if names - {*WRITTEN} or (names and TOML not in names):
        raise UserError(f"{folder}: holds something else; name another folder with --out")
    if names and not force:
        raise UserError(
            f"{folder}: holds a creature already, maybe edited by hand; name another folder with "
            "--out, or write over it with --force"
        )


def write_folder(folder: Path, imported: Imported) -> None:
    """Write the creature folder, after checking that its texts load.

    Raises:
      UserError: the texts are not a creature, or the folder cannot be written.
    """
    load_files(imported.files)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in imported.files.items():
            write_text(folder / name, text)
