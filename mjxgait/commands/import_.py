"""`mjxgait import`: make a creature folder from a model file."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.importing import ImportChoices, Imported, import_model

Words = Annotated[tuple[str, ...], tyro.conf.UseAppendAction]


@dataclasses.dataclass(frozen=True)
class ImportOptions:
    """Make a creature folder from a model file (MJCF or URDF), and tell every change and guess.

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
    """

    model: tyro.conf.Positional[Path]
    out: Path
    name: str | None = None
    search: Words = ()
    keep: Words = ()
    freeze: Words = ()
    up: Literal["x", "y", "z"] | None = None
    forward: Literal["x", "-x", "y", "-y"] | None = None


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
    )
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


def write_folder(folder: Path, imported: Imported) -> None:
    """Writes the creature folder and loads it once.

    Raises:
      UserError: the folder holds something else, or cannot be written.
    """
    if folder.exists() and (
        not folder.is_dir() or any(file.name not in imported.files for file in folder.iterdir())
    ):
        raise UserError(f"{folder}: holds something else; name another folder with --out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in imported.files.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror})") from None
    load_creature(folder)
