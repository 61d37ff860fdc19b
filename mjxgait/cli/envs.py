"""`mjxgait envs`: the shipped creatures and configs."""

import dataclasses
from collections.abc import Sequence

import tyro

from mjxgait.config.layers import data_folder, find_creature, shipped_configs, shipped_creatures
from mjxgait.creature import load_creature


@dataclasses.dataclass(frozen=True)
class EnvsOptions:
    """List the shipped creatures and configs."""


def envs_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    tyro.cli(EnvsOptions, args=list(arguments), prog="mjxgait envs")
    for name in shipped_creatures():
        creature = load_creature(find_creature(name))
        print(f"{name:20} {creature.settings.creature.description}")
    for name in shipped_configs():
        text = (data_folder("configs") / f"{name}.toml").read_text(encoding="utf-8")
        print(f"{name:20} {text.splitlines()[0].lstrip('# ')}")
    return 0
