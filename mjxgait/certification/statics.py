"""Torques that carry a body in a step: gravity against vertical contact forces, in C MuJoCo.

In a step half of the feet are in the air, so a leg carries twice its share of the standing weight.
How high the trunk is and where a sole presses is free: the least torque counts. Inertia and impacts
come on top.

Letters: `C` contact points, `J` actuated joints, `j` those of one leg.
"""

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.creature import FLOOR, vertical_freedom
from mjxgait.creature.textbook import Leg

SINK = 0.02
"""Hip heights by which the standing body is lowered: feet this near to the floor touch it."""
IN_A_STEP = 2.0
"""Load of a leg in a step over its load in standing."""
LOWER = (-0.15, -0.1, -0.05, 0.0, 0.1)
"""Hip heights by which the trunk is lower than standing: straighter legs carry with less torque."""
REACHED = 0.02
"""Hip heights from a place within which a foot has reached it."""
EVEN = 1e-3
"""Weight of an even distribution, against the balance of the body."""


@dataclasses.dataclass(frozen=True)
class Load:
    """The most loaded joint of a leg. joint: "" if it carries nothing. needed, limit: N·m."""

    joint: str = ""
    needed: float = 0.0
    limit: float = np.inf

    @property
    def share(self) -> float:
        """Torque over torque limit."""
        return self.needed / self.limit


class Statics:
    """A body at rest in its standing pose.

    points: [C, 3] m, places of the contacts in the frames of their bodies. bodies: [C] ids.
    feet: [C] foot of each, -1 for other parts that may touch the floor. weights: [C] N.
    """

    def __init__(self, creature: Creature) -> None:
        self.creature, self.model = creature, creature.model
        self.data = mujoco.MjData(self.model)
        self.stand = creature.stand_qpos - SINK * creature.frame.hip_height * vertical_freedom(
            self.model
        )
        self._pose(self.stand)
        self._touch()
        self.weights = self._weights()

    def in_a_step(self, leg: Leg, foot: int, ways: Sequence[float]) -> Load:
        """Return the load of a leg in a step, at the height of the trunk where it is least.

        ways: m of the foot ahead of its place.
        """
        own = np.flatnonzero(self.feet == foot)
        if not len(own) or not len(leg.joints):
            return Load()
        found = [self._at_height(leg, own, ways, lower) for lower in LOWER]
        known = [load for load in found if load is not None]
        known = known or [self._carries(leg, own, self.creature.joints.stand)]
        return min(known, key=lambda load: load.share)

    def _at_height(
        self, leg: Leg, own: np.ndarray, ways: Sequence[float], lower: float
    ) -> Load | None:
        """Load at a height of the trunk; None if the foot does not reach its places there.

        own: contacts of the foot. lower: hip heights below standing.
        """
        joints, loads = self.creature.joints, []
        for way in ways:
            angles = joints.stand.copy()
            angles[leg.joints] = leg.reach((way, 0.0), joints.stand, lower)
            if leg.missed((way, 0.0), angles, lower) > REACHED:
                return None
            loads.append(self._carries(leg, own, angles))
        return max(loads, key=lambda load: load.share)

    def _carries(self, leg: Leg, own: np.ndarray, angles: np.ndarray) -> Load:
        """Load with all joints at these angles [J]."""
        pose = self.stand.copy()
        pose[self.creature.joints.qpos_adr] = angles
        self._pose(pose)
        return self._load(leg.joints, self._least_torques(leg, own))

    def standing(self, joints: np.ndarray) -> Load:
        """Return the load in standing of joints [j] that belong to no single leg."""
        if not len(joints):
            return Load()
        self._pose(self.stand)
        lifts = self._lifts(np.arange(len(self.weights)))
        torques = self._hold() - lifts.T @ self.weights
        return self._load(joints, torques[self.creature.joints.dof_adr[joints]])

    def _load(self, joints: np.ndarray, torques: np.ndarray) -> Load:
        limits = self.creature.gains.torque_limit[joints]
        worst = int((np.abs(torques) / limits).argmax())
        name = self.creature.joints.names[int(joints[worst])]
        return Load(name, float(abs(torques[worst])), float(limits[worst]))

    def _pose(self, qpos: np.ndarray) -> None:
        self.data.qpos[:] = qpos
        mujoco.mj_forward(self.model, self.data)

    def _hold(self) -> np.ndarray:
        """Generalised force [nv] that holds the body up in the air, less that of its springs."""
        return np.asarray(self.data.qfrc_bias - self.data.qfrc_passive)

    def _touch(self) -> None:
        """Find the contacts of the standing pose."""
        feet, data, floor = self.creature.feet, self.data, self.model.geom(FLOOR).id
        foot_of = dict(zip(feet.stepping, feet.foot_of_geoms, strict=True))
        foot_of |= dict.fromkeys(feet.ground_ids, -1)
        found: list[tuple[np.ndarray, int, int]] = []
        for place, pair in zip(data.contact.pos, data.contact.geom, strict=True):
            geom = int(pair.sum()) - floor
            if floor in pair and geom in foot_of:
                body = int(self.model.geom_bodyid[geom])
                arm = data.xmat[body].reshape(3, 3).T @ (place - data.xpos[body])
                found.append((arm, body, foot_of[geom]))
        self.points = np.array([arm for arm, _, _ in found]).reshape(-1, 3)
        self.bodies = np.array([body for _, body, _ in found], int)
        self.feet = np.array([foot for _, _, foot in found], int)

    def _weights(self) -> np.ndarray:
        """Share the weight between the contacts, as evenly between feet as the balance allows."""
        from scipy.optimize import lsq_linear  # slow to import, and few runs need it

        centre, hip = self.data.subtree_com[self.creature.trunk], self.creature.frame.hip_height
        count = len(self.points)
        if not count:
            return np.zeros(0)
        at = np.array([self._place(c) for c in range(count)]).reshape(-1, 3)
        beside = np.sqrt([(self.feet == foot).sum() for foot in self.feet])
        balance = np.vstack([np.ones(count), (at - centre)[:, :2].T / hip]) / beside
        wanted = np.concatenate([[1.0], np.zeros(2 + count)])
        shares = lsq_linear(np.vstack([balance, EVEN * np.eye(count)]), wanted, (0.0, np.inf)).x
        return np.asarray(self.creature.frame.mass * self.creature.gravity * shares / beside)

    def _least_torques(self, leg: Leg, points: np.ndarray) -> np.ndarray:
        """Torques [j] N·m in a step, where it presses on its points so that the worst is least.

        A linear program over the weight on each point and the largest share of the limits.
        """
        from scipy.optimize import linprog  # slow to import, and few runs need it

        weight = self.creature.frame.mass * self.creature.gravity
        carried = min(IN_A_STEP * float(self.weights[points].sum()), weight)
        limits = self.creature.gains.torque_limit[leg.joints]
        dofs = self.creature.joints.dof_adr[leg.joints]
        lifts, hold = self._lifts(points)[:, dofs].T, self._hold()[dofs]
        found = linprog(
            np.append(np.zeros(len(points)), 1.0),
            np.vstack([np.column_stack([way * lifts, -limits]) for way in (-1, 1)]),
            np.concatenate([-hold, hold]),
            np.append(np.ones(len(points)), 0.0)[None],
            [carried],
        )
        return np.asarray(hold - lifts @ found.x[:-1])

    def _lifts(self, points: np.ndarray) -> np.ndarray:
        """Height [c, nv] that each contact gains by each degree of freedom, m/rad."""
        moves = np.zeros((len(points), 3, self.model.nv))
        for row, point in zip(moves, points, strict=True):
            place, body = self._place(int(point)), int(self.bodies[point])
            mujoco.mj_jac(self.model, self.data, row, None, place, body)
        return moves[:, 2]

    def _place(self, point: int) -> np.ndarray:
        body = self.bodies[point]
        turned = self.data.xmat[body].reshape(3, 3) @ self.points[point]
        return np.asarray(self.data.xpos[body] + turned)
