"""Distance of a creature's parts from the bar of the task limbo.

Letters: `S` simulations, `G` geoms.
"""

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.reference.layout import start_frame

RADIUS = 0.01
"""m, half the thickness of the bar along the way."""
REACH = 10.0
"""m; reach of the bar up from its lower edge, and to both sides."""
FAR = 0.1
"""m; larger distances are not measured."""


class Clearance:
    """Distances of geoms from a bar that is not part of the simulation."""

    def __init__(self, creature: Creature) -> None:
        start = start_frame(creature)
        self.place, self.axes = start.place, np.stack([start.forward, start.left, [0.0, 0.0, 1.0]])
        self.model = _with_bar(creature)
        self.bar = self.model.geom("the bar").id
        self.parts = np.flatnonzero(creature.model.geom_bodyid != 0)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)

    def of(self, xpos: np.ndarray, xmat: np.ndarray, bar: np.ndarray) -> np.ndarray:
        """Return the distance [S] in m of the nearest part, at most `FAR`; negative inside the bar.

        Args:
          xpos: [S, G, 3] m, of all geoms of the creature's model. xmat: [S, G, 9].
          bar: [S, 2] m, middle of the bar ahead of the start, lower edge above the floor.
        """
        nearest = np.full(len(xpos), FAR)
        along = (xpos - self.place * [1, 1, 0]) @ self.axes.T
        along[..., [0, 2]] -= bar[:, None]
        room = self.model.geom_rbound[self.parts] + FAR
        near = (np.abs(along[:, self.parts, 0]) < room + RADIUS) & (along[:, self.parts, 2] > -room)
        for row, part in np.argwhere(near):
            geom = self.parts[part]
            self.data.geom_xpos[geom] = along[row, geom]
            self.data.geom_xmat[geom] = (self.axes @ xmat[row, geom].reshape(3, 3)).ravel()
            found = mujoco.mj_geomDistance(self.model, self.data, int(geom), self.bar, FAR, None)
            nearest[row] = min(nearest[row], found)
        return nearest


def _with_bar(creature: Creature) -> mujoco.MjModel:
    """Return the creature's model with the bar as last geom, lower edge at the world's origin."""
    spec = mujoco.MjSpec.from_string(creature.files["creature.xml"])
    body = spec.worldbody.add_body(name="the bar", pos=[0.0, 0.0, REACH])
    size = [RADIUS, REACH, REACH]
    body.add_geom(name="the bar", type=mujoco.mjtGeom.mjGEOM_BOX, size=size)
    return spec.compile()
