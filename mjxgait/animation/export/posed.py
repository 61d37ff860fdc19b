"""Poses of a character's nodes: those that follow the creature, and all that hang on them.

Letters: `F` key frames, `N` nodes of the file.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np

from mjxgait.animation.export.character import Character


@dataclasses.dataclass(frozen=True, eq=False)
class Goal:
    """Transforms [F, 4, 4] of a node in the scene. free: whether its place is animated too."""

    world: np.ndarray
    free: bool


def posed(character: Character, goals: Mapping[int, Goal]) -> tuple[np.ndarray, np.ndarray]:
    """Transforms [F, N, 4, 4] of all nodes against their parents, and in the scene.

    A node with a goal turns to it, and a free one goes there; all others rest against their
    parents.
    """
    frames = len(next(iter(goals.values())).world)
    local = np.tile(character.local, (frames, 1, 1, 1))
    world = np.zeros_like(local)
    for node in character.order:
        parent = character.parents[node]
        above = world[:, parent] if parent >= 0 else np.tile(np.eye(4), (frames, 1, 1))
        if goal := goals.get(node):
            own = np.linalg.solve(above, goal.world)
            local[:, node, :3, :3] = own[:, :3, :3]
            if goal.free:
                local[:, node, :3, 3] = own[:, :3, 3]
        world[:, node] = above @ local[:, node]
    return local, world
