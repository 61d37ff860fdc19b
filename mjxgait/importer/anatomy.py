"""Bodies, joints, feet and shapes of a compiled model in one pose.

Letters: `B` bodies, `J` joints, as in MuJoCo's arrays.
"""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.importer.parts import Shape, read_shapes
from mjxgait.importer.root import turn_up


@dataclasses.dataclass(eq=False)
class Anatomy:
    """Anatomy of a creature in one pose, up is z.

    qpos: [nq] that pose. xpos [B, 3] m, xrot [B, 3, 3]: bodies in it. root: body id. bodies: ids of
    the creature's bodies, parents first. active: ids of joints that move. feet: ids of the last
    moving body of each leg. scale: m per unit of length. shapes: of each body, scaled. lowered:
    whether qpos has the limbs let down instead of the file's zero pose.
    """

    qpos: np.ndarray
    xpos: np.ndarray
    xrot: np.ndarray
    root: int
    bodies: list[int]
    active: list[int]
    feet: list[int]
    scale: float
    shapes: dict[int, list[Shape]]
    lowered: bool = False

    def low(self, model: mujoco.MjModel, bodies: Sequence[int]) -> float:
        """Lowest point in m of some bodies; the lowest body frame where they have no shapes."""
        heights = []
        for b in bodies:
            solid = [s for s in self.shapes[b] if s.solid] or self.shapes[b]
            heights += [
                float((self.xpos[b] + s.points @ self.xrot[b].T)[:, 2].min() - s.radius)
                for s in solid
            ]
            if not solid:
                heights.append(float(self.xpos[b][2]))
        return min(heights)


def measured(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    axis: np.ndarray,
    root: int,
    bodies: list[int],
    scale: float,
) -> Anatomy:
    """Measure the creature in one pose, without joints and feet. axis: [3], up in the file."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    turn = turn_up(axis)
    shapes = {}
    for b in bodies:
        shapes[b] = read_shapes(model, b)
        for s in shapes[b]:
            s.size, s.pos, s.points, s.radius = (
                s.size * scale,
                s.pos * scale,
                s.points * scale,
                s.radius * scale,
            )
    xrot = turn @ data.xmat.reshape(-1, 3, 3)
    return Anatomy(qpos, scale * data.xpos @ turn.T, xrot, root, bodies, [], [], scale, shapes)
