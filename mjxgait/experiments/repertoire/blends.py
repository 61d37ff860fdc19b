"""Half-way blends between two walks of a repertoire, tested in C MuJoCo.

An engine blends poses without physics. Here the two controllers are blended and the body is
simulated: if it walks, the engine's blend is near to what the body can do.
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
"""Numbers of the criteria that decide whether a blend walks: up, ahead, in a rhythm."""


@dataclasses.dataclass(frozen=True)
class Blend:
    """Blend of two certified neighbours. fails: criteria of a walk that it does not meet."""

    between: tuple[Cell, Cell]
    fails: tuple[str, ...]

    @property
    def walks(self) -> bool:
        """Whether the blend meets all criteria of a walk."""
        return not self.fails

    @property
    def entry(self) -> dict[str, Any]:
        """Entry of the table."""
        names = [cell.name for cell in self.between]
        return {"between": names, "walks": self.walks, "fails": list(self.fails)}


def blends(
    folder: Path,
    creature: Creature,
    grid: Grid,
    found: list[Found],
    tell: Callable[[int, int], object],
) -> list[Blend]:
    """Return a blend for each of the `certified_pairs`. tell: called with counts done and total."""
    return of_each(_blended, folder, certified_pairs(creature, grid, found), tell)


def _blended(folder: Path, pair: Pair) -> Blend:
    """Test a pair in its own process, which receives only the walks' place."""
    (creature, one), (_, other) = (open_champion(folder / cell.name) for cell in pair)
    seen = glance(creature, half_way(one, other, creature))
    judged = [criterion for criterion in seen.criteria if criterion.number in WALKS]
    return Blend(pair, tuple(criterion.name for criterion in judged if not criterion.passed))


def half_way(one: Champion, other: Champion, creature: Creature) -> Champion:
    """Return the mean of two controllers, pose by pose, with the mean of their targets."""
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
    """Return all poses [C, J] of a champion's cycle."""
    poses = champion.genome["key_poses"]
    if not (champion.settings.mirror and creature.mirror.symmetric):
        return poses
    return np.concatenate([poses, mirrored(poses, creature)])


def _between(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    turn = (one.get("turn", 0.0) + other.get("turn", 0.0)) / 2
    speed = (one["speed"] + other["speed"]) / 2
    told = {name: value for name, value in one.items() if name not in ("turn", "steer")}
    return {**told, "speed": speed} | ({"turn": turn} if turn else {})
