"""Additional measurements of a modular body: centre of mass, momentum, drag, depth in the ground.

Letters: `T` frames.
"""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True, eq=False)
class Grown:
    """Measurements of a modular body, in world axes.

    middle: [T, 3] m, centre of mass. momentum: [T, 3] N·s. push: [T, 3] N, total water force.
    low: [T] m, lowest point of all blocks. buried: [T] greatest depth of a block in the ground, as
    a share of its size. sizes: m by name of the part, cube root of its volume.
    """

    middle: np.ndarray
    momentum: np.ndarray
    push: np.ndarray
    low: np.ndarray
    buried: np.ndarray
    sizes: Mapping[str, float]

    def window(self, frames: slice) -> "Grown":
        """Return some of the frames."""
        arrays = {
            f.name: getattr(self, f.name)[frames]
            for f in dataclasses.fields(self)
            if f.name != "sizes"
        }
        return Grown(**arrays, sizes=self.sizes)


def seen_grown(creature: Creature, qpos: np.ndarray, qvel: np.ndarray, drag: float) -> Grown:
    """Measure a motion [T, nq], [T, nv]; frames after it blew up are NaN.

    drag: N·s/m³ of the water; 0 without. The velocity of a block's middle along the normal gives
    the force on a face (docs/blocks.md); the reference simulator sums points instead.
    """
    model, data = creature.model, mujoco.MjData(creature.model)
    boxes = np.flatnonzero(model.geom_bodyid > 0)
    half, size = model.geom_size[boxes], np.cbrt(8 * model.geom_size[boxes].prod(1))
    middle, momentum, push = (np.full((len(qpos), 3), np.nan) for _ in range(3))
    low, buried = (np.full(len(qpos), np.nan) for _ in range(2))
    velocity = np.zeros(6)
    for k in np.flatnonzero(np.isfinite(qpos).all(1) & np.isfinite(qvel).all(1)):
        data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        momentum[k] = push[k] = 0.0
        for box in boxes:
            kind, mass = mujoco.mjtObj.mjOBJ_GEOM, model.body_mass[model.geom_bodyid[box]]
            mujoco.mj_objectVelocity(model, data, kind, box, velocity, 0)
            momentum[k] += mass * velocity[3:]
            push[k] += _push(model.geom_size[box], data.geom_xmat[box], velocity[3:], drag)
        middle[k] = data.subtree_com[creature.trunk]
        reach = (np.abs(data.geom_xmat[boxes, 6:]) * half).sum(1)
        lows = data.geom_xpos[boxes, 2] - reach
        low[k], buried[k] = lows.min(), (-lows / size).max()
    names = [model.body(model.geom_bodyid[box]).name for box in boxes]
    sizes = dict(zip(names, size.tolist(), strict=True))
    return Grown(middle, momentum, push, low, np.maximum(buried, 0.0), sizes)


def _push(half: np.ndarray, rotation: np.ndarray, velocity: np.ndarray, drag: float) -> np.ndarray:
    """Return the force [3] in N on a block with this velocity of its middle."""
    normals = rotation.reshape(3, 3)
    # Each area is that of two opposite faces.
    areas = 8 * half[[1, 2, 0]] * half[[2, 0, 1]]
    pushed: np.ndarray = -drag * normals @ (areas * (velocity @ normals))
    return pushed
