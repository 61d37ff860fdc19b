"""The controller of docs/controller.md in NumPy and float64, written from that page alone and for
many simulations at once.

Letters: `S` simulations, `J` actuated joints, `C` poses in the cycle, `nv` degrees of freedom.
"""

import dataclasses

import numpy as np

from mjxgait.certify.layout import start_frame
from mjxgait.champion import Champion
from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True, eq=False)
class Senses:
    """What the controller reads of the current state.

    joint_pos: [S, J] rad. velocity: [S, nv] m/s, rad/s.
    trunk_pos: [S, 3] m. trunk_rot: [S, 3, 3], columns are the trunk's axes in the world.
    trunk_angvel: [S, 3] rad/s, world frame.
    mass_matrix: [S, nv, nv]. bias: [S, nv], Coriolis and gravity less passive forces.
    constraint_force: [S, nv], of the previous step's solve.
    """

    joint_pos: np.ndarray
    velocity: np.ndarray
    trunk_pos: np.ndarray
    trunk_rot: np.ndarray
    trunk_angvel: np.ndarray
    mass_matrix: np.ndarray
    bias: np.ndarray
    constraint_force: np.ndarray


class Controller:
    """Tracks a champion's pose cycle.

    It holds constants only; the positions in the cycle are the caller's.

    Raises:
      UserError: a key pose or a tuning value is not a finite number.
    """

    def __init__(self, creature: Creature, champion: Champion) -> None:
        champion.check_finite(creature.joint_names)
        self.creature = creature
        self.settings = champion.controller
        self.tuning = champion.tuning
        self.cycle = (
            pose_cycle(champion.key_poses, creature)
            if champion.controller.mirror
            else champion.key_poses
        )
        self.kp, self.kd = (
            champion.controller.stiffness * creature.kp,
            champion.controller.damping * creature.kd,
        )
        self.length = len(self.cycle) * champion.controller.interpolation
        self.start = start_frame(creature)

    def planned(self, position: np.ndarray) -> np.ndarray:
        """Uncorrected target [S, J] in rad at cycle positions [S]."""
        a, step = np.divmod(position, self.settings.interpolation)
        f = (step / self.settings.interpolation)[:, None]
        return (1 - f) * self.cycle[a] + f * self.cycle[(a + 1) % len(self.cycle)]

    def target(
        self, position: np.ndarray, senses: Senses, heading: float | None = None
    ) -> np.ndarray:
        """Target [S, J] in rad with steering and balance, within the joints' ranges; `heading`
        is the commanded one in rad.
        """
        creature = self.creature
        steer, pitch, roll = (part[:, None] for part in self.corrections(senses, heading))
        stretched = creature.stand + (self.planned(position) - creature.stand) * (
            1 + steer * creature.steer_stride
        )
        target = (
            stretched
            + steer * creature.steer_bend
            + pitch * creature.balance_pitch
            + roll * creature.balance_roll
        )
        return np.clip(target, creature.joint_low, creature.joint_high)

    def corrections(
        self, senses: Senses, heading: float | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`u`, `p` and `r` of docs/controller.md, [S] each."""
        creature, gain = self.creature, self.tuning
        forward, left = senses.trunk_rot @ creature.forward, senses.trunk_rot @ creature.left
        start = self.start
        wrong = np.arctan2(forward @ start.left, forward @ start.forward)
        if heading is None:
            aside = (senses.trunk_pos - start.place) @ start.left
            wrong = wrong + aside / (2 * creature.body_length)
        else:
            wrong = wrong - heading
        nose_down = -np.arcsin(np.clip(forward[:, 2], -1, 1))
        right_down = np.arcsin(np.clip(left[:, 2], -1, 1))
        pitch = gain["pitch"] * nose_down + gain["pitch_rate"] * (senses.trunk_angvel * left).sum(1)
        roll = gain["roll"] * right_down + gain["roll_rate"] * (senses.trunk_angvel * forward).sum(
            1
        )
        return (
            np.clip(gain["steer"] * wrong, -0.5, 0.5),
            np.clip(pitch, -0.5, 0.5),
            np.clip(roll, -0.5, 0.5),
        )

    def torque(
        self,
        target: np.ndarray,
        senses: Senses,
        time_step: float,
        stiffness: np.ndarray | float = 1.0,
        damping: np.ndarray | float = 1.0,
    ) -> np.ndarray:
        """Joint torques [S, J] in N·m towards the target [S, J], stable PD or plain PD.

        Stable PD is that of Tan, Liu & Turk (2011). stiffness, damping: factors on kp and kd,
        [S, J] or one for all.
        """
        creature, kp, kd = self.creature, stiffness * self.kp, damping * self.kd
        v = senses.velocity[:, creature.dof_adr]
        if self.settings.law == "pd":
            wanted = -kp * (senses.joint_pos - target) - kd * v
        else:
            spring_damper = -kp * (senses.joint_pos + time_step * v - target) - kd * v
            acceleration = self._predicted_acceleration(spring_damper, senses, time_step * kd)
            wanted = spring_damper - time_step * kd * acceleration
        return np.clip(wanted, -creature.torque_limit, creature.torque_limit)

    def _predicted_acceleration(
        self, spring_damper: np.ndarray, senses: Senses, damping: np.ndarray
    ) -> np.ndarray:
        """Of the actuated joints [S, J], with the coming step's damping taken implicitly.

        damping: [J] or [S, J], time step times kd.
        """
        dof = self.creature.dof_adr
        force = -senses.bias
        if self.settings.constraint_forces:
            force = force + senses.constraint_force
        force[:, dof] += spring_damper
        damped = senses.mass_matrix.copy()
        damped[:, dof, dof] += damping
        return np.linalg.solve(damped, force[..., None])[:, dof, 0]

    def advance(
        self,
        position: np.ndarray,
        target: np.ndarray,
        joint_pos: np.ndarray,
        next_step: int,
        time_step: float,
    ) -> np.ndarray:
        """Positions [S] at the next control step.

        target, joint_pos: [S, J] of this step. next_step: its number, counted from 0. time_step: s.
        """
        if self.settings.advance == "clock":
            return np.full_like(position, self._by_clock(next_step, time_step))
        error = np.sqrt(((target - joint_pos) ** 2).mean(1))
        return np.where(error < self.tuning["threshold"], (position + 1) % self.length, position)

    def _by_clock(self, step: int, time_step: float) -> int:
        turn = int(float(np.float32(time_step) / np.float32(self.tuning["period"])) * 2**32)
        place = step * turn % 2**32 // 2**16
        return (place + 1) * self.length // 2**16 % self.length


def pose_cycle(key_poses: np.ndarray, creature: Creature) -> np.ndarray:
    """[C, J] rad: the key poses [K, J], followed by their mirror images where the creature is
    symmetric.
    """
    if not creature.symmetric:
        return key_poses
    return np.concatenate([key_poses, creature.sign * key_poses[:, creature.partner]])
