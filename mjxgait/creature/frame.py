"""Where a creature starts: the directions and the place that its way is measured from."""

import mujoco
import numpy as np

from mjxgait.creature.load import Creature
from mjxgait.ground.spec import Place


def start_axes(creature: Creature) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal unit vectors [3] forward and left of the nominal standing pose, in the world."""
    forward = (creature.stand_rot @ creature.forward) * [1, 1, 0]
    forward = forward / np.linalg.norm(forward)
    return forward.astype(np.float32), np.cross([0, 0, 1], forward).astype(np.float32)


def start_position(creature: Creature) -> np.ndarray:
    """[3] m, where the trunk stands at the start."""
    return creature.stand_pos.astype(np.float32)


def start_place(creature: Creature) -> Place:
    """Where the creature starts on its ground."""
    return Place(
        creature.stand_pos, start_axes(creature)[0], creature.hip_height, creature.body_length
    )


def horizontal_freedoms(creature: Creature) -> np.ndarray:
    """[2, nv] generalised velocity of the trunk moving at 1 m/s along the world's x and y; zero
    where the root cannot move so.
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
