"""`mjxgait import`: make a creature folder from a model file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from mjxgait.creature.scale import load_files
from mjxgait.errors import UserError
from mjxgait.files import write_text
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
    """Make a creature folder from a model file (MJCF or URDF) or from a character's skeleton (BVH, or a
    skinned GLB), and tell every change and guess.

    Attributes:
      model: The file.
      out: Folder to make.
      name: Name of the creature; the file's name by default.
      search: Further folders that may be read for meshes, package:// paths and includes; may be
        given several times.
      keep: Pattern of joints that stay movable though no leg hangs on them; may be given several
        times.
      freeze: Pattern of joints to freeze; may be given several times.
      up: Axis of the file that points up, where the guess is wrong.
      forward: Axis along which it should walk, where the guess is wrong.
      height: Metres that a skeleton is tall at rest, where the guess of its unit is wrong.
      seconds: Processor time that MuJoCo may take to compile the model.
      gigabytes: Memory that it may take for that.
      force: Write over a creature folder that is there already.
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
    """Returns the exit code."""
    options = tyro.cli(ImportOptions, args=list(arguments), prog="mjxgait import")
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
    """Whether a creature may be written there, before the import takes its time.

    Args:
      read: folders that the import reads besides the model's own. force: a creature may be lost.

    Raises:
      UserError: the model or what it needs lies there, or anything that is no creature, or a
        creature without `force`.
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
    """Write the creature folder, once its texts have been loaded.

    Raises:
      UserError: the texts are no creature, or the folder cannot be written.
    """
    load_files(imported.files)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in imported.files.items():
            write_text(folder / name, text)
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror})") from None
