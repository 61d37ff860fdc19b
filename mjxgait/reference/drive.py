"""Drive of docs/controller.md in NumPy and float64, written from that page alone.

Letters: `S` simulations, `J` actuated joints, `nv` degrees of freedom.
"""

import dataclasses

import numpy as np

from mjxgait.controllers.key_poses.config import DriveConfig
from mjxgait.creature import Creature
from mjxgait.reference.controllers.protocol import Command
from mjxgait.reference.state import State


@dataclasses.dataclass(frozen=True, eq=False)
class Drive:
    """Conversion of a command to joint torques. step: s between two commands."""

    creature: Creature
    settings: DriveConfig
    command: Command
    step: float

    def torque(
        self,
        wanted: np.ndarray,
        state: State,
        stiffness: np.ndarray | float = 1.0,
        damping: np.ndarray | float = 1.0,
    ) -> np.ndarray:
        """Return joint torques [S, J] in N·m for a command [S, J].

        Stable PD (Tan, Liu & Turk 2011) or plain PD tracks a pose.
        stiffness, damping: factors on kp and kd, [S, J] or one for all.
        """
        limit = self.creature.gains.torque_limit
        if self.command == "pose":
            wanted = self._pull(wanted, state, stiffness, damping)
        return np.clip(wanted, -limit, limit)

    def _pull(
        self,
        target: np.ndarray,
        state: State,
        stiffness: np.ndarray | float,
        damping: np.ndarray | float,
    ) -> np.ndarray:
        creature, step = self.creature, self.step
        kp = stiffness * self.settings.stiffness * creature.gains.kp
        kd = damping * self.settings.damping * creature.gains.kd
        v = state.velocity[:, creature.joints.dof_adr]
        if self.settings.law == "pd":
            return -kp * (state.joint_pos - target) - kd * v
        spring_damper = -kp * (state.joint_pos + step * v - target) - kd * v
        acceleration = self._predicted_acceleration(spring_damper, state, step * kd)
        return spring_damper - step * kd * acceleration

    def _predicted_acceleration(
        self, spring_damper: np.ndarray, state: State, damping: np.ndarray
    ) -> np.ndarray:
        """Predict the acceleration [S, J] of the actuated joints.

        The next step's damping is taken implicitly.
        damping: [J] or [S, J], time step times kd.
        """
        dof = self.creature.joints.dof_adr
        force = -state.bias
        if self.settings.constraint_forces:
            force = force + state.constraint_force
        force[:, dof] += spring_damper
        damped = state.mass_matrix.copy()
        damped[:, dof, dof] += damping
        return np.linalg.solve(damped, force[..., None])[:, dof, 0]
