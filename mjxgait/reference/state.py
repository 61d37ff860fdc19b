"""State of simulations, and observations by name, written from docs/reference/controller.md.

Letters: `S` simulations, `J` actuated joints, `F` feet, `nv` degrees of freedom.
"""

import dataclasses
from collections.abc import Callable, Collection, Mapping

import numpy as np

from mjxgait.controllers.config import DriveConfig
from mjxgait.creature import Creature
from mjxgait.reference.controllers import Command
from mjxgait.reference.layout import Ground, StartFrame, level_nose

CONTACT_GAP = 0.002
"""m; a foot nearer to the floor counts as in contact."""


@dataclasses.dataclass(frozen=True, eq=False)
class State:
    """State of many simulations at one moment.

    start: common start frame. ground: None for the plane z = 0.
    time: [S] s since the start. joint_pos: [S, J] rad. velocity: [S, nv] m/s, rad/s.
    trunk_pos: [S, 3] m. trunk_rot: [S, 3, 3], columns are the trunk's axes in the world.
    trunk_vel: [S, 3] m/s, trunk_angvel: [S, 3] rad/s, world frame.
    foot_height: [S, F] m, lowest point above the floor; empty if unused.
    foot_pos: [S, F, 3] m, middle of each foot; empty if unused.
    own_gap: [S, F] m from each block to the nearest other one of its body; empty if unused.
    mass_matrix: [S, nv, nv]. bias: [S, nv], Coriolis and gravity less passive forces.
    constraint_force: [S, nv], from the previous step.
    light: [S, F, 3] direction in the axes of each foot's geom, 0 without a light; empty if unused.
    goal, bar: [S] m ahead of the start; without them 0 and infinite. None where a state is made
    without a task.
    """

    start: StartFrame
    ground: Ground | None
    time: np.ndarray
    joint_pos: np.ndarray
    velocity: np.ndarray
    trunk_pos: np.ndarray
    trunk_rot: np.ndarray
    trunk_vel: np.ndarray
    trunk_angvel: np.ndarray
    foot_height: np.ndarray
    mass_matrix: np.ndarray
    bias: np.ndarray
    constraint_force: np.ndarray
    goal: np.ndarray | None = None
    bar: np.ndarray | None = None
    light: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0, 3)))
    foot_pos: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0, 3)))
    own_gap: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))


Sense = Callable[[Creature, State], np.ndarray]


def _heading(creature: Creature, state: State) -> np.ndarray:
    nose = state.trunk_rot @ creature.frame.forward
    return np.arctan2(nose @ state.start.left, nose @ state.start.forward)


def _along(state: State, axis: np.ndarray) -> np.ndarray:
    return (state.trunk_pos - state.start.place) @ axis


def _height(state: State) -> np.ndarray:
    x, y, z = state.trunk_pos.T
    return z if state.ground is None else z - state.ground.height(x, y)


def _nose_down(creature: Creature, state: State) -> np.ndarray:
    return -np.arcsin(np.clip((state.trunk_rot @ creature.frame.forward)[:, 2], -1, 1))


def _right_down(creature: Creature, state: State) -> np.ndarray:
    return np.arcsin(np.clip((state.trunk_rot @ creature.frame.left)[:, 2], -1, 1))


def _nose(creature: Creature, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return horizontal unit vectors [S, 3] along the nose and to its left."""
    nose = level_nose(creature, state.trunk_rot)
    return nose, np.cross([0.0, 0.0, 1.0], nose)


def _contact(creature: Creature, state: State) -> np.ndarray:
    """Return 1 for feet on the floor and, where the controller observes it, on other blocks."""
    gap = np.minimum(state.foot_height, state.own_gap) if state.own_gap.size else state.foot_height
    return (gap < CONTACT_GAP).astype(float)


SENSES: Mapping[str, Sense] = {
    "time": lambda creature, state: state.time,
    "beat": lambda creature, state: 2 * np.mod(state.time, 1.0) - 1,
    "joint_pos": lambda creature, state: state.joint_pos,
    "joint_vel": lambda creature, state: state.velocity[:, creature.joints.dof_adr],
    "foot_height": lambda creature, state: state.foot_height,
    "contact": _contact,
    "trunk_pos": lambda creature, state: state.trunk_pos,
    "trunk_height": lambda creature, state: _height(state),
    "trunk_rot": lambda creature, state: state.trunk_rot,
    "trunk_vel": lambda creature, state: state.trunk_vel,
    "trunk_angvel": lambda creature, state: state.trunk_angvel,
    "heading": _heading,
    "forward": lambda creature, state: _along(state, state.start.forward),
    "aside": lambda creature, state: _along(state, state.start.left),
    "forward_vel": lambda creature, state: state.trunk_vel @ state.start.forward,
    "nose_vel": lambda creature, state: np.stack(
        [(state.trunk_vel * axis).sum(1) for axis in _nose(creature, state)], 1
    ),
    "foot_place": lambda creature, state: np.stack(
        [
            ((state.foot_pos - state.trunk_pos[:, None]) * axis[:, None]).sum(2)
            for axis in _nose(creature, state)
        ],
        2,
    ),
    "up_vel": lambda creature, state: state.trunk_vel[:, 2],
    "pitch": _nose_down,
    "roll": _right_down,
    "pitch_rate": lambda creature, state: (
        state.trunk_angvel * (state.trunk_rot @ creature.frame.left)
    ).sum(1),
    "roll_rate": lambda creature, state: (
        state.trunk_angvel * (state.trunk_rot @ creature.frame.forward)
    ).sum(1),
}


def _left(state: State, place: np.ndarray | None) -> np.ndarray:
    return (0.0 if place is None else place) - _along(state, state.start.forward)


ADDED: Mapping[str, Sense] = {
    "goal_distance": lambda creature, state: _left(state, state.goal),
    "light": lambda creature, state: state.light,
    "bar_distance": lambda creature, state: _left(state, state.bar),
}
"""Observations added by shipped tasks (hop.md, limbo.md, follow.md in docs/reference/)."""
OWN_CONTACT = "own_contact"
"""Name among a controller's `reads` by which "contact" also answers to blocks of its own body."""
FOOT_SENSES = ("foot_height", "contact", "foot_place")
"""Observations that need `foot_height` or `foot_pos`."""


def sense(creature: Creature, state: State, names: Collection[str]) -> dict[str, np.ndarray]:
    """Return the observations of these names, each [S, ...]."""
    known = {**SENSES, **ADDED}
    return {name: known[name](creature, state) for name in names if name in known}


@dataclasses.dataclass(frozen=True, eq=False)
class Drive:
    """Conversion of a command to joint torques.

    step: s, time step of the simulation; a command may be held for several.
    """

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
