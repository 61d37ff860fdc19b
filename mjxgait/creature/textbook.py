"""A textbook cycle, computed from a body's geometry and its footfalls alone.

In stance a foot moves back evenly beneath the trunk; in swing it comes forward in an arc. The
joints follow by inverse kinematics. The cycle is not simulated: evolution may start from it.
Letters: `N` feet, `C` poses of the cycle, `J` joints.
"""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.creature import Creature

CROUCH = 0.05
"""Hip heights by which the trunk is lower than standing, so that legs reach ahead and back."""
TURN = 0.02
"""Hip heights of a foot's position error that weigh as much as one radian of its rotation error:
feet stay level where the leg has joints to spare."""
ROUNDS, DAMPING = 20, 1e-3


@dataclasses.dataclass(frozen=True)
class Footfalls:
    """Timing and size of the steps.

    phases: middle of each foot's stance, in cycles. duty: duty factor, the stance's share of the
    cycle. stride, lift: m, way of the body in a cycle, and height of a swing.
    """

    phases: Sequence[float]
    duty: float
    stride: float
    lift: float


def textbook_cycle(creature: Creature, falls: Footfalls, poses: int) -> np.ndarray:
    """Angles [C, J] rad, within the pose ranges, at `poses` moments of the cycle."""
    legs = [Leg(creature, foot) for foot in range(len(creature.feet.names))]
    cycle = np.tile(creature.joints.stand, (poses, 1))
    for leg, phase in zip(legs, falls.phases, strict=True):
        # Twice around: in the second round the first moment, too, starts from the one before it.
        for moment in [*range(poses), *range(poses)]:
            share = (moment / poses - phase + falls.duty / 2) % 1.0
            cycle[moment, leg.joints] = leg.reach(_path(share, falls), cycle[moment - 1])
    return cycle


def _path(share: float, falls: Footfalls) -> tuple[float, float]:
    """Way of a foot in m ahead of and above its standing place, at a share of its own cycle."""
    half = 0.5 * falls.duty * falls.stride
    if share < falls.duty:
        return half * (1.0 - 2.0 * share / falls.duty), 0.0
    swing = (share - falls.duty) / (1.0 - falls.duty)
    return -half * np.cos(np.pi * swing), falls.lift * np.sin(np.pi * swing)


class Leg:
    """The joints that move one foot and no other, and their kinematics.

    sideways: weight of a foot's distance to the side of its place, against that ahead or above.
    """

    def __init__(self, creature: Creature, foot: int, sideways: float = 1.0) -> None:
        model, feet = creature.model, creature.feet
        self.creature, self.model = creature, model
        self.data = mujoco.MjData(model)
        own = feet.geoms_of(foot)
        self.body = int(model.geom_bodyid[own[0]])
        others = [int(model.geom_bodyid[g]) for g in feet.stepping if g not in own]
        shared = {b for other in others for b in geometry.ancestors(model, other)}
        chain = [b for b in geometry.ancestors(model, self.body) if b not in shared]
        bodies = model.dof_bodyid[creature.joints.dof_adr]
        self.joints = np.flatnonzero(np.isin(bodies, chain))
        self._pose(creature.joints.stand)
        place = self.data.geom_xpos[own].mean(0)
        self.arm = self.data.xmat[self.body].reshape(3, 3).T @ (place - self.data.xpos[self.body])
        self.place, self.level = place, self.data.xmat[self.body].reshape(3, 3).copy()
        nose = self.data.xmat[creature.trunk].reshape(3, 3) @ creature.frame.forward * [1, 1, 0]
        self.ahead = nose / np.linalg.norm(nose)
        left = np.cross([0.0, 0.0, 1.0], self.ahead)
        self.counts = np.eye(3) - (1.0 - sideways) * np.outer(left, left)

    def reach(
        self, path: tuple[float, float], pose: np.ndarray, crouch: float = CROUCH
    ) -> np.ndarray:
        """Angles of the leg's joints [j] that bring the foot nearest to a place.

        Damped least squares, starting from a pose [J]. crouch: hip heights.
        """
        joints, goal = self.creature.joints, self._goal(path, crouch)
        pose = pose.copy()
        low, high = joints.pose_low[self.joints], joints.pose_high[self.joints]
        for _ in range(ROUNDS):
            off, slopes = self._off(goal, pose)
            square = slopes.T @ slopes + DAMPING * np.eye(len(self.joints))
            moved = pose[self.joints] + np.linalg.solve(square, slopes.T @ off)
            pose[self.joints] = np.clip(moved, low, high)
        return pose[self.joints]

    def missed(self, path: tuple[float, float], pose: np.ndarray, crouch: float = CROUCH) -> float:
        """Distance of the foot in a pose [J] from a place, in hip heights."""
        off, _ = self._off(self._goal(path, crouch), pose)
        return float(np.linalg.norm(off[:3]))

    def _goal(self, path: tuple[float, float], crouch: float) -> np.ndarray:
        """Place [3] in m of the foot, ahead of and above where it stands."""
        ahead, above = path
        up = above + crouch * self.creature.frame.hip_height
        return np.asarray(self.place + ahead * self.ahead + [0, 0, up])

    def _off(self, goal: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Error [6] to the goal, in hip heights, and its slopes [6, j]."""
        self._pose(pose)
        hip, turned = self.creature.frame.hip_height, self.data.xmat[self.body].reshape(3, 3)
        point = self.data.xpos[self.body] + turned @ self.arm
        moves, turns = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, moves, turns, point, self.body)
        dofs = self.creature.joints.dof_adr[self.joints]
        # Half the sum of the cross products of the columns: written out, it takes a tenth.
        both = 0.5 * self.level @ turned.T
        tilt = (both - both.T)[[2, 0, 1], [1, 2, 0]]
        off = np.concatenate([self.counts @ (goal - point) / hip, TURN * tilt])
        return off, np.concatenate([self.counts @ moves[:, dofs] / hip, TURN * turns[:, dofs]])

    def _pose(self, pose: np.ndarray) -> None:
        self.data.qpos[:] = self.creature.stand_qpos
        self.data.qpos[self.creature.joints.qpos_adr] = pose
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
