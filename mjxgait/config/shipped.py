"""Locations of the shipped creatures and configs."""

from importlib import resources
from pathlib import Path
from typing import Literal

from mjxgait.errors import UserError, did_you_mean


def data_folder(kind: Literal["envs", "configs"]) -> Path:
    """Return the folder of shipped creatures or configs: in the package or in the checkout."""
    package = Path(str(resources.files("mjxgait")))
    packaged = package / "data" / kind
    return packaged if packaged.is_dir() else package.parent / kind


def install_command(extra: str) -> str:
    """Return the command that installs an extra, of the package or of the checkout in use."""
    checkout = Path(str(resources.files("mjxgait"))).parent
    if not (checkout / "pyproject.toml").is_file():
        return f'pip install "mjxgait[{extra}]"'
    # Editable: a plain install would replace the checkout by a copy of the package.
    place = "." if checkout.resolve() == Path.cwd().resolve() else checkout
    return f'pip install -e "{place}[{extra}]"'


def shipped_creatures() -> list[str]:
    """Return the names of the shipped creatures."""
    return sorted(path.parent.name for path in data_folder("envs").glob("*/creature.toml"))


def shipped_configs() -> list[str]:
    """Return the names of the shipped configs."""
    return sorted(path.stem for path in data_folder("configs").glob("*.toml"))


def find_creature(name: str) -> Path:
    """Return the folder of a shipped creature, or the folder at a path.

    Raises:
      UserError: lists the known creatures.
    """
    known = shipped_creatures()
    if name in known:
        return data_folder("envs") / name
    folder = Path(name)
    if (folder / "creature.toml").is_file():
        return folder
    if folder.is_dir():
        raise UserError(
            f"{folder}: no creature folder (it has no creature.toml); `mjxgait import` makes one of a "
            "model file"
        )
    if folder.suffix or len(folder.parts) > 1:
        raise UserError(f"{folder}: no such file or folder")
    raise UserError(
        f'unknown creature "{name}"; {did_you_mean(name, known)} '
        "(`mjxgait envs` lists all; the path of a folder or of a model file will do too)"
    )
