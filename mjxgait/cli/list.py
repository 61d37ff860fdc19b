"""`mjxgait list`: what ships with the program, under headings."""

import dataclasses
from collections.abc import Mapping, Sequence

from mjxgait.cli.options import parsed
from mjxgait.config.layers import data_folder, find_creature, shipped_configs, shipped_creatures
from mjxgait.config.tables import read_toml
from mjxgait.creature import load_creature
from mjxgait.creature.ground.spec import DIRECTIONS, FLAT, MAX_SIZE
from mjxgait.kinds import controllers, tasks
from mjxgait.tasks.walk.gaits import AUTO, GAITS
from mjxgait.tasks.walk.targets import NATURAL

GROUNDS = {
    "slope": "rise per metre",
    "steps": "height of a step in hip heights",
    "bumps": "height in hip heights",
    "rough": "height in hip heights",
}
"""Meaning of the number of each kind of ground."""


@dataclasses.dataclass(frozen=True)
class ListOptions:
    """List what ships: creatures, configurations, tasks, controllers, gaits, and more."""


def list_command(arguments: Sequence[str]) -> int:
    """Return the exit code."""
    parsed(ListOptions, "list", arguments)
    print("\n\n".join(_section(heading, lines) for heading, lines in _sections().items()))
    return 0


def _section(heading: str, lines: Mapping[str, str]) -> str:
    return "\n".join([heading, *(f"  {name:18} {what}" for name, what in lines.items())])


def _sections() -> dict[str, dict[str, str]]:
    """Return what ships, by heading; each heading ends with the option that takes the names."""
    studies = sorted((data_folder("configs") / "ablations").glob("*.toml"))
    styles = sorted((data_folder("configs") / "styles").glob("*.toml"))
    return {
        "creatures (--env)": {name: _described(name) for name in shipped_creatures()},
        "configurations (--config)": {
            name: _comment((data_folder("configs") / f"{name}.toml").read_text(encoding="utf-8"))
            for name in shipped_configs()
        },
        "tasks (--task)": {kind.name: kind.what for kind in tasks().values()},
        "controllers (--controller)": {kind.name: kind.what for kind in controllers().values()},
        "gaits (--gait)": {
            **{f"{feet} feet": ", ".join(table) for feet, table in GAITS.items()},
            "any": f"{NATURAL} (an animal's at this speed), {AUTO} (whatever evolves)",
        },
        "styles (--style)": {
            file.stem: _comment(file.read_text(encoding="utf-8")) for file in styles
        },
        "grounds (--ground)": {FLAT: "the plane"} | {k: _ground(k) for k in DIRECTIONS},
        "studies (mjxgait ablate)": {
            file.stem: str(read_toml(file)["question"]) for file in studies
        },
    }


def _described(creature: str) -> str:
    return load_creature(find_creature(creature)).settings.creature.description


def _ground(kind: str) -> str:
    ways = "".join(f", :{way}" for way in DIRECTIONS[kind][1:])
    return f"{kind}:NUMBER{ways}; {GROUNDS[kind]}, at most {MAX_SIZE[kind]:g}"


def _comment(text: str) -> str:
    """Return the first sentence of the comment that a file begins with."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        if not (words := line.strip("# ")):
            break
        lines.append(words)
    return " ".join(lines).partition(". ")[0].rstrip(".:")
