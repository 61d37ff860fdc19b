"""Start place and directions, from which a creature's way is measured."""

import mujoco
import numpy as np

from mjxgait.creature.creature import Creature
from mjxgait.creature.ground.spec import Place


def start_place(creature: Creature) -> Place:
    """Start place of the creature on its ground."""
    return Place(
        creature.frame.stand_pos,
        creature.frame.start_axes[0],
        creature.frame.hip_height,
        creature.frame.body_length,
    )


def horizontal_freedoms(creature: Creature) -> np.ndarray:
    """Generalised velocities [2, nv] of the trunk moving at 1 m/s along the world's x and y.

    Zero where the root cannot move so.
    """
    model = creature.model
    moves = np.zeros((2, model.nv))
    for joint in range(model.njnt):
        if model.jnt_bodyid[joint] != creature.trunk:
            continue
        dof = model.jnt_dofadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            moves[:, dof : dof + 2] = np.eye(2)
        elif model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            moves[:, dof] = model.jnt_axis[joint][:2]
    return moves.astype(np.float32)


def vertical_freedom(model: mujoco.MjModel) -> np.ndarray:
    """Change of the positions [nq] that lifts every root by 1 m; zero if a root cannot rise."""
    rises = np.zeros(model.nq)
    for joint in range(model.njnt):
        place = model.jnt_qposadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            rises[place + 2] = 1.0
        elif model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            at_root = model.body_parentid[model.jnt_bodyid[joint]] == 0
            rises[place] = (
                at_root * (abs(model.jnt_axis[joint][2]) > 0.99) * model.jnt_axis[joint][2]
            )
    return rises
