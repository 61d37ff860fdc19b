"""`mjxgait envs`: what is shipped."""

import dataclasses
from collections.abc import Sequence

import tyro

from mjxgait.creature import load_creature
from mjxgait.settings.shipped import data_folder


@dataclasses.dataclass(frozen=True)
class EnvsOptions:
    """List the shipped creatures and configs."""


def envs_command(arguments: Sequence[str]) -> int:
    """Returns the exit code."""
    tyro.cli(EnvsOptions, args=list(arguments), prog="mjxgait envs")
    for folder in sorted(data_folder("envs").glob("*/creature.toml")):
        print(
            f"{folder.parent.name:20} {load_creature(folder.parent).settings.creature.description}"
        )
    for file in sorted(data_folder("configs").glob("*.toml")):
        print(f"{file.stem:20} {file.read_text(encoding='utf-8').splitlines()[0].lstrip('# ')}")
    return 0
