"""Robots by name, `robot:go2`: models that the package robot_descriptions downloads and keeps."""

import dataclasses
import difflib
import importlib
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from mjxgait.errors import UserError
from mjxgait.extras import install_command

PREFIX = "robot:"
ENDINGS = ("_mj_description", "_description")
"""Ends of a description's name in the package: MJCF, which states more of a body, and URDF."""
MOST_NEAR = 8


@dataclasses.dataclass(frozen=True)
class Robot:
    """A model file, and the folders in which its meshes are."""

    file: Path
    search: tuple[Path, ...]


def robot_name(model: Path | str) -> str | None:
    """Return the name after `robot:`; None for all else, such as a path."""
    text = str(model)
    return text.removeprefix(PREFIX) if text.startswith(PREFIX) else None


def find_robot(name: str) -> Robot:
    """Return the model of a robot; its repository is downloaded the first time.

    Raises:
      UserError: the package is missing, the name is unknown, or nothing can be downloaded.
    """
    try:
        known = importlib.import_module("robot_descriptions").DESCRIPTIONS
    except ImportError:
        raise UserError(f"{PREFIX}{name} needs an extra: {install_command('robots')}") from None
    usable = {key: about for key, about in known.items() if about.has_mjcf or about.has_urdf}
    wanted = name.lower().replace("-", "_")
    keys = [key for key in (wanted, *(wanted + end for end in ENDINGS)) if key in usable]
    if not keys:
        raise UserError(f"{PREFIX}{name}: no robot has this name; {_near(wanted, usable)}")
    try:
        # The module clones a repository with git when it is imported. Git, the network and the disk
        # raise errors of many kinds.
        return _files(importlib.import_module(f"robot_descriptions.{keys[0]}"))
    except Exception as error:
        said = str(getattr(error, "stderr", "") or error) or type(error).__name__
        why = " ".join(said.split()).removeprefix("stderr: ").strip("'")
        raise UserError(
            f"{PREFIX}{name}: its model cannot be downloaded ({why}); that takes git and a network "
            "the first time; or give the path of a model file"
        ) from None


def _files(module: ModuleType) -> Robot:
    folders = (Path(module.PACKAGE_PATH), Path(module.REPOSITORY_PATH))
    for stated in ("MJCF_PATH", "URDF_PATH"):
        if hasattr(module, stated):
            return Robot(Path(getattr(module, stated)), folders)
    # A template, which the package expands with its own arguments.
    expand = importlib.import_module("robot_descriptions._xacro").get_urdf_path
    return Robot(Path(expand(module)), folders)


def _near(name: str, known: Mapping[str, Any]) -> str:
    """Return the names nearest to this one, of the robot or of its maker, in words."""
    short = {key: key.removesuffix("_description").removesuffix("_mj") for key in known}
    like = (short[k] for k, about in known.items() if name in f"{k} {about.maker}".lower())
    near = sorted(set(like)) if name else []
    near = near or difflib.get_close_matches(name, set(short.values()), cutoff=0.5)
    listed = f"near it: {', '.join(near[:MOST_NEAR])}" if near else "none is near it"
    return f"{listed}; `python -m robot_descriptions list` shows all"
