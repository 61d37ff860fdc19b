"""Corners of a body, to be projected."""

import itertools

import mujoco
import numpy as np

SIGNS = np.array(list(itertools.product((-1, 1), repeat=3)))


def corners(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """World positions [points, 3] m of the corners of all boxes, by MuJoCo."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    boxes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    return np.concatenate(
        [
            data.geom_xpos[g] + SIGNS * model.geom_size[g] @ data.geom_xmat[g].reshape(3, 3).T
            for g in boxes
        ]
    )
