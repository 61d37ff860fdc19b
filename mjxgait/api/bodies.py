"""A creature folder from a model file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from mjxgait.api.run import Place
from mjxgait.creature import Creature, load_creature
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.files import path_of, writing
from mjxgait.importer import TOML, WRITTEN, ImportChoices, Imported
from mjxgait.importer import import_model as read_model
from mjxgait.output import Tell, silent
from mjxgait.training.folder import write_creature


def import_model(
    model: Place,
    out: Place,
    *,
    name: str | None = None,
    search: Sequence[Place] = (),
    keep: Sequence[str] = (),
    freeze: Sequence[str] = (),
    up: Literal["x", "y", "z"] | None = None,
    forward: Literal["x", "-x", "y", "-y"] | None = None,
    height: float | None = None,
    force: bool = False,
    tell: Tell = silent,
) -> Creature:
    """Make a creature folder from a model (MJCF, URDF, xacro, BVH, GLB, FBX); return the creature.

    Does the same as `mjxgait import` (docs/guide/your-own-body.md).

    Args:
      model: the file, or robot:NAME.
      out: the folder to make.
      name: of the creature; by default the file's.
      search: further folders for meshes and includes.
      keep: patterns of joints that stay movable although they carry no leg.
      freeze: patterns of joints to freeze.
      up: axis of the file that points up, if the guess is wrong.
      forward: walking direction, if the guess is wrong.
      height: m; of a skeleton at rest.
      force: overwrites an existing creature folder.
      tell: called with the notes of the import.

    Raises:
      UserError: the file cannot be used, or the folder not be written, with the reason.
    """
    file, folder, places = path_of(model), path_of(out), tuple(map(path_of, search))
    choices = ImportChoices(name, places, tuple(keep), tuple(freeze), up, forward, height)
    imported = into_folder(file, folder, choices, force)
    tell(imported.notes.text())
    return load_creature(folder)


def into_folder(model: Path, folder: Path, choices: ImportChoices, force: bool) -> Imported:
    """Import a model into a folder; see `check_folder` and `write_folder` for errors."""
    check_folder(folder, choices.search, model, force)
    imported = read_model(model, choices)
    write_folder(folder, imported)
    return imported


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
            f"{folder}: the import reads from this folder, so it writes nothing there; name "
            "another with --out"
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
    creature_of(imported.files)
    with writing(folder):
        write_creature(folder, imported.files)
