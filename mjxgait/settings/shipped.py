"""Where the creatures and configs lie that come with the program."""

from importlib import resources
from pathlib import Path
from typing import Literal

from mjxgait.errors import UserError


def data_folder(kind: Literal["envs", "configs"]) -> Path:
    """Where the shipped creatures or configs lie: inside the installed package, or beside it in a checkout."""
    package = Path(str(resources.files("mjxgait")))
    packaged = package / "data" / kind
    return packaged if packaged.is_dir() else package.parent / kind


def shipped_creatures() -> list[str]:
    """Names of the creatures that come with the program."""
    return sorted(path.parent.name for path in data_folder("envs").glob("*/creature.toml"))


def find_creature(name: str) -> Path:
    """The folder of a shipped creature, or the folder at a path.

    Raises:
      UserError: lists the known creatures.
    """
    known = shipped_creatures()
    if name in known:
        return data_folder("envs") / name
    folder = Path(name)
    if (folder / "creature.toml").is_file():
        return folder
    raise UserError(
        f'unknown creature "{name}"; shipped: {", ".join(known)}; or give the path of a folder with creature.xml and creature.toml'
    )
