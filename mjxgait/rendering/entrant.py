"""A walk in a scene: turned into the scene's direction, and painted in its own colours.

Letters: `G` geoms.
"""

import numpy as np

from mjxgait.rendering.painter import COMPASS, Painter
from mjxgait.rendering.shapes import Silhouettes
from mjxgait.rendering.walk import Walk

UP = np.array([0.0, 0.0, 1.0])


class Entrant:
    """A participant of a scene, before its shift into a lane.

    outline: [points, 3] m, outermost points of the creature at the start. across, along: m, its
    width and length. top: m, its highest point. back: m, its hindmost point along the direction of
    travel, from the start.
    """

    def __init__(self, walk: Walk, origin: np.ndarray, forward: np.ndarray) -> None:
        """Scene's start, origin [2] m, and direction of travel, forward [2] unit."""
        self.walk, self.origin = walk, origin
        self.start, self.step = walk.trunk_pos[0, :2], walk.time_step
        ahead, left = walk.forward @ forward, _left(walk.forward) @ forward
        self.turn = np.array([[ahead, -left, 0.0], [left, ahead, 0.0], UP])
        self.painter = Painter(walk.shown)
        self._measure(np.append(forward, 0.0))

    def frame(self, time: float) -> int:
        """Return the walk's frame at s since the start; its last once it is over."""
        return min(round(time / self.step), len(self.walk.qpos) - 1)

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Return points [..., 3] m of the walk's own world in the scene."""
        return (points - np.append(self.start, 0.0)) @ self.turn.T + np.append(self.origin, 0.0)

    def trunk(self, time: float) -> np.ndarray:
        """Return the trunk's position [3] m in the scene."""
        return self.placed(self.walk.trunk_pos[self.frame(time)])

    def poses(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions [G, 3] m and rotations [G, 3, 3] in the scene of all geoms shown."""
        pos, rot = self.walk.geom_poses(np.array([self.frame(time)]))
        return self.placed(pos[0]), self.turn @ rot[0]

    def ground_heights(self, places: np.ndarray) -> np.ndarray:
        """Return the ground heights [n] m at places [n, 2] m of the scene."""
        own = (places - self.origin) @ self.turn[:2, :2] + self.start
        return self.walk.ground_heights(own)

    def _measure(self, forward: np.ndarray) -> None:
        model = self.walk.creature.model
        own = self.painter.geoms[self.painter.geoms < model.ngeom]
        pos, rot = (poses[own] for poses in self.poses(0.0))
        left = np.cross(UP, forward)
        side = pos @ left - (pos @ left).mean()
        far = np.clip(side / max(float(np.abs(side).max()), 1e-6), 0.0, 1.0)
        self.painter.far[: len(own)] = far
        flat = np.column_stack([COMPASS, np.zeros(len(COMPASS))])
        outline = Silhouettes(model, own).outermost(pos, rot, np.concatenate([flat, [UP, -UP]]))
        self.outline = outline.reshape(-1, 3)
        self.across, self.along = np.ptp(self.outline @ left), np.ptp(self.outline @ forward)
        self.top = float(self.outline[:, 2].max())
        self.back = float(((self.outline[:, :2] - self.origin) @ forward[:2]).min())


def _left(forward: np.ndarray) -> np.ndarray:
    return np.array([-forward[1], forward[0]])
