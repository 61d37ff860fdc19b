"""Depth of overlap between parts of champions: `python benchmarks/overlap.py RUN...`.

Measured by C MuJoCo on the true shapes (`mj_geomDistance`), in every other frame of the undisturbed
walk of 20 s, between parts that are not neighbours, beyond their depth in the standing pose.
"""

import json
import sys
from collections.abc import Iterable
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.certification import verdict_of
from mjxgait.certification.trials import simulate
from mjxgait.creature import Creature
from mjxgait.creature.overlap import NEAR, neighbours
from mjxgait.reference.starts import nominal_starts
from mjxgait.training.folder import CERTIFICATE, open_champion

SECONDS = 20.0
EVERY = 2
"""Frames per measured frame."""
WORTH = 0.01
"""Depth in hip heights above which a frame counts as overlapping."""


class Depths:
    """Measures one creature. pairs: [n, 2] geom ids. usual: [n] m, depth when standing or 0."""

    def __init__(self, creature: Creature) -> None:
        self.model, self.data = creature.model, mujoco.MjData(creature.model)
        self._place(creature.stand_qpos)
        near = neighbours(self.model, self.data, NEAR * creature.frame.hip_height)
        body = self.model.geom_bodyid
        moving = np.flatnonzero(self.model.body_weldid[body] != 0)
        self.pairs = np.array(
            [(a, b) for a in moving for b in moving if a < b and not near[body[a], body[b]]]
        )
        self.usual = np.array([max(self._depth(a, b), 0.0) for a, b in self.pairs])

    def of(self, qpos: np.ndarray) -> tuple[float, tuple[str, ...]]:
        """Return the greatest depth in a pose [nq], m, and its parts; 0 if standing is as deep."""
        self._place(qpos)
        bound = self.model.geom_rbound[self.pairs].sum(1)
        centre = self.data.geom_xpos[self.pairs]
        close = np.linalg.norm(centre[:, 0] - centre[:, 1], axis=1) < bound
        found = [
            (self._depth(*self.pairs[k]) - self.usual[k], tuple(map(self._name, self.pairs[k])))
            for k in np.flatnonzero(close)
        ]
        return max([(0.0, ("", "")), *found])

    def _place(self, qpos: np.ndarray) -> None:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)

    def _depth(self, a: int, b: int) -> float:
        return -mujoco.mj_geomDistance(self.model, self.data, a, b, 0.001, None)

    def _name(self, geom: int) -> str:
        return self.model.geom(geom).name or self.model.body(self.model.geom_bodyid[geom]).name


def walk_of(folder: Path) -> tuple[Creature, np.ndarray]:
    """Return the creature of a run, and its champion's undisturbed walk [T, nq]."""
    creature, champion = open_champion(folder)
    walk = simulate(creature, champion, nominal_starts(creature, 1), SECONDS, record=1).trajectory
    return creature, walk.qpos[0]


def describe(folder: Path) -> str:
    """Return one line of the table."""
    creature, walk = walk_of(folder)
    depths = Depths(creature)
    found = [depths.of(qpos) for qpos in walk[::EVERY]]
    deep = np.array([depth for depth, _ in found]) / creature.frame.hip_height
    names = " in ".join(max(found)[1])
    passed, speed = "not examined", np.nan
    if (folder / CERTIFICATE).exists():
        text = json.loads((folder / CERTIFICATE).read_text(encoding="utf-8"))
        passed, speed = "yes" if verdict_of(text).certified else "no", text["report"]["speed"]
    return (
        f"| {folder.name} | {deep.max() * creature.frame.hip_height * 1e3:.1f} mm, "
        f"{deep.max():.1%} | {names} "
        f"| {(deep > WORTH).mean():.0%} | {passed} | {speed:.2f} |"
    )


def main(folders: Iterable[str]) -> None:
    """Print a table."""
    print(
        "| run | deepest | whose | frames beyond 1 % | certified | m/s |\n|---|---|---|---|---|---|"
    )
    for folder in folders:
        print(describe(Path(folder)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
