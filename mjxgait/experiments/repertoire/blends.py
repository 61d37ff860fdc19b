"""What lies half way between two walks of a repertoire, tried in C MuJoCo.

An engine blends poses and knows no physics. Here the two controllers are blended and their body is
simulated: where that walks, the engine's blend is near to what the body can do.
"""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.certification import glance
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire.cells import mirrored
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.grid import Cell, Grid
from mjxgait.experiments.repertoire.pairs import Pair, certified_pairs, of_each
from mjxgait.training.folder import open_champion

WALKS = (1, 2, 3)
"""Numbers of the criteria that say whether it walks: up, ahead, in a rhythm."""


@dataclasses.dataclass(frozen=True)
class Blend:
    """Of two neighbours that are certified. fails: criteria of a walk that it does not meet."""

    between: tuple[Cell, Cell]
    fails: tuple[str, ...]

    @property
    def walks(self) -> bool:
        """Whether it meets all of them."""
        return not self.fails

    @property
    def entry(self) -> dict[str, Any]:
        """For the table."""
        names = [cell.name for cell in self.between]
        return {"between": names, "walks": self.walks, "fails": list(self.fails)}


def blends(
    folder: Path,
    creature: Creature,
    grid: Grid,
    found: list[Found],
    tell: Callable[[int, int], object],
) -> list[Blend]:
    """Of all that `certified_pairs` has. tell: called with how many are done, and of how many."""
    return of_each(_blended, folder, certified_pairs(creature, grid, found), tell)


def _blended(folder: Path, pair: Pair) -> Blend:
    """In a process of its own: all that is sent is where the walks are."""
    (creature, one), (_, other) = (open_champion(folder / cell.name) for cell in pair)
    seen = glance(creature, half_way(one, other, creature))
    judged = [criterion for criterion in seen.criteria if criterion.number in WALKS]
    return Blend(pair, tuple(criterion.name for criterion in judged if not criterion.passed))


def half_way(one: Champion, other: Champion, creature: Creature) -> Champion:
    """The mean of two controllers, each pose with the pose in its place, told the mean of what both
    were told.
    """
    cycles = [_cycle(champion, creature) for champion in (one, other)]
    genome = {
        "key_poses": np.mean(cycles, axis=0),
        "tuning": np.mean([one.genome["tuning"], other.genome["tuning"]], axis=0),
    }
    steps = round((one.settings.interpolation + other.settings.interpolation) / 2)
    settings = dataclasses.replace(
        one.settings, mirror=False, key_poses=len(cycles[0]), interpolation=steps
    )
    wish = _between(one.wish, other.wish)
    return dataclasses.replace(one, genome=genome, settings=settings, wish=wish)


def _cycle(champion: Champion, creature: Creature) -> np.ndarray:
    """All poses [C, J] of its cycle."""
    poses = champion.genome["key_poses"]
    if not (champion.settings.mirror and creature.mirror.symmetric):
        return poses
    return np.concatenate([poses, mirrored(poses, creature)])


def _between(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    turn = (one.get("turn", 0.0) + other.get("turn", 0.0)) / 2
    speed = (one["speed"] + other["speed"]) / 2
    told = {name: value for name, value in one.items() if name not in ("turn", "steer")}
    return {**told, "speed": speed} | ({"turn": turn} if turn else {})
