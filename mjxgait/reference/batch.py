"""Many simulations of one model in C MuJoCo, each with its own body, floor, slope and start."""

import mujoco
import numpy as np
from mujoco.batch import Batch

from mjxgait.creature import Creature
from mjxgait.reference.starts import Starts


def batch_of(creature: Creature, model: mujoco.MjModel, starts: Starts) -> Batch:
    """Return the simulations at their initial conditions."""
    batch = Batch(model, len(starts), 1, persistent=True)
    batch.expand("geom_friction")[:, :, 0] *= starts.friction[:, None]
    batch.expand("body_mass")[:] *= starts.mass
    batch.expand("body_inertia")[:] *= starts.mass[:, :, None]
    batch.expand("opt.gravity")[:] = _gravity(model, starts.slope)
    # Softness sets the impedance: the time constant is already as short as the time step allows.
    impedance = batch.expand("geom_solimp")[:, :, :2]
    impedance /= impedance + starts.floor[:, None, None] * (1 - impedance)
    batch.expand("opt.timestep")[:] /= starts.refine
    batch.set_const()
    batch.reset(stage=int(mujoco.mjtStage.mjSTAGE_NONE))
    qpos = batch.bind("qpos")
    qpos[:] = creature.stand_qpos
    qpos[:, creature.joints.qpos_adr] += starts.joint_offset
    batch.bind("qvel")[:, creature.joints.dof_adr] = starts.joint_velocity
    return batch


def _gravity(model: mujoco.MjModel, slope: np.ndarray) -> np.ndarray:
    """Return gravity [S, 3], tilted instead of the floor by slopes [S, 2]; see `worlds.sloping`."""
    angle = np.linalg.norm(slope, axis=1, keepdims=True)
    uphill = slope / np.where(angle > 0, angle, 1.0)
    change = np.concatenate([-np.sin(angle) * uphill, 1 - np.cos(angle)], 1)
    return model.opt.gravity + np.linalg.norm(model.opt.gravity) * change
