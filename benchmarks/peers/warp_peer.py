"""MuJoCo Warp on a creature's evolution model: the bare step, without a controller of ours.

MuJoCo Warp steps as a whole, so stable PD cannot stand between position and acceleration. Springs
and dampers with the creature's gains hold the standing pose instead, and nothing is measured: this
rival does less than `ours` and `mjx`.
"""

import copy
import time

import mujoco
import numpy as np

from mjxgait.creature import Creature

CONTACTS = 24
"""Contacts per world that memory is allocated for; a fallen dog touches with fewer."""


def held_model(creature: Creature) -> mujoco.MjModel:
    """Return the evolution model with springs and dampers that hold the standing pose."""
    model, joints, gains = copy.copy(creature.evolution_model), creature.joints, creature.gains
    hinges = model.dof_jntid[joints.dof_adr]
    model.jnt_stiffness[hinges], model.qpos_spring[joints.qpos_adr] = gains.kp, joints.stand
    model.dof_damping[joints.dof_adr] = gains.kd
    return model


class WarpPeer:
    """`lanes` worlds that stand, stepped `steps` times in a pass."""

    def __init__(self, creature: Creature, lanes: int, steps: int) -> None:
        # Not a dependency: only this benchmark uses it.
        import mujoco_warp
        import warp

        self.warp, self.steps, self.lanes = warp, steps, lanes
        self.trunk = creature.trunk
        self.model = held_model(creature)
        self.start = mujoco.MjData(self.model)
        self.start.qpos = creature.stand_qpos
        mujoco.mj_forward(self.model, self.start)
        self.worlds = mujoco_warp.put_data(
            self.model, self.start, nworld=lanes, nconmax=CONTACTS, njmax=4 * CONTACTS
        )
        numbers = mujoco_warp.put_model(self.model)
        began = time.perf_counter()
        mujoco_warp.step(numbers, self.worlds)
        warp.synchronize()
        with warp.ScopedCapture() as captured:
            mujoco_warp.step(numbers, self.worlds)
        self.graph = captured.graph
        warp.synchronize()
        self.compile_s = time.perf_counter() - began

    def lap(self) -> None:
        """Step all worlds from the start."""
        for name in ("qpos", "qvel", "qacc_warmstart"):
            rows = np.tile(np.float32(getattr(self.start, name)), (self.lanes, 1))
            getattr(self.worlds, name).assign(rows)
        for _ in range(self.steps):
            self.warp.capture_launch(self.graph)
        self.warp.synchronize()

    def heights(self) -> np.ndarray:
        """Heights [lanes] of the trunks in m."""
        return self.worlds.xpos.numpy()[:, self.trunk, 2]

    @property
    def standing(self) -> float:
        """Share of the worlds with a trunk above half of its standing height."""
        return float((self.heights() > 0.5 * self.start.xpos[self.trunk, 2]).mean())
