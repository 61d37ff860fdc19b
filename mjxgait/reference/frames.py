"""Measurements of recorded frames: places of parts and contacts with the floor.

Quantities that need no MuJoCo call per frame are computed for all frames at the end.
Letters: `T` frames.
"""

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.geometry import beside
from mjxgait.reference.bar import Clearance
from mjxgait.reference.layout import LowestPoint, per_foot
from mjxgait.reference.stepping import examined_model
from mjxgait.reference.terrain import terrain_of


class FrameReader:
    """Reader of frames from an MjData; a frame not read is NaN (`touch`: true)."""

    def __init__(self, creature: Creature, frames: int, bar: np.ndarray | None) -> None:
        self.creature, self.model = creature, examined_model(creature)
        self.data = mujoco.MjData(self.model)
        count = len(creature.feet.names)
        foot_geoms = creature.feet.watched[: len(creature.feet.foot_of)]
        self.feet = LowestPoint(self.model, foot_geoms, terrain_of(creature))
        self.foot_of_geom = np.full(self.model.ngeom, -1)
        self.foot_of_geom[foot_geoms] = creature.feet.foot_of
        self.may_touch = np.isin(np.arange(self.model.ngeom), [*foot_geoms, *creature.feet.ground])
        self.floor = self.model.geom("floor").id
        self.trunk_pos, self.trunk_rot = (
            np.full((frames, 3), np.nan),
            np.full((frames, 3, 3), np.nan),
        )
        self.foot_force, self.foot_slip, self.foot_height = (
            np.full((frames, count), np.nan) for _ in range(3)
        )
        self.bar, self.over = bar, None if bar is None else Clearance(creature)
        self.clearance = np.full(frames, np.nan)
        # Kept for `finish`, which handles all frames at once.
        model, self.seen = self.model, 0
        self.geom_xpos, self.geom_xmat = (
            np.empty((frames, model.ngeom, 3)),
            np.empty((frames, model.ngeom, 9)),
        )
        self.cvel = np.empty((frames, model.nbody, 6))
        self.xipos, self.subtree_com = (np.empty((frames, model.nbody, 3)) for _ in range(2))
        self.contacts: list[tuple[np.ndarray, ...]] = []
        self.touch, self.penetration, self.body_speed = (
            np.ones(frames, bool),
            np.full(frames, np.nan),
            np.full(frames, np.nan),
        )

    def read(self, k: int, qpos: np.ndarray, qvel: np.ndarray, torque: np.ndarray) -> None:
        """Read one frame; frames come in order of time."""
        data, creature = self.data, self.creature
        data.qpos[:], data.qvel[:] = qpos, qvel
        data.qfrc_applied[creature.joints.dof_adr] = torque
        mujoco.mj_forward(self.model, data)
        self.trunk_pos[k], self.trunk_rot[k] = (
            data.xpos[creature.trunk],
            data.xmat[creature.trunk].reshape(3, 3),
        )
        self.geom_xpos[k], self.geom_xmat[k] = data.geom_xpos, data.geom_xmat
        self.cvel[k] = data.cvel
        self.xipos[k], self.subtree_com[k] = data.xipos, data.subtree_com
        self._contacts(k)
        self.seen = k + 1

    def finish(self) -> None:
        """Compute what follows from the poses and contacts of all frames read."""
        seen = slice(self.seen)
        poses = self.geom_xpos[seen], self.geom_xmat[seen]
        self.foot_height[seen] = per_foot(self.creature, self.feet.heights(*poses))
        arm = self.xipos[seen] - self.subtree_com[seen][:, self.model.body_rootid]
        own = ~beside(self.model, self.creature.settings.creature.beside)
        own[0] = False
        speed = np.linalg.norm(_moving(self.cvel[seen], arm)[:, own], axis=2)
        self.body_speed[seen] = speed.max(1)
        self._loads()
        if self.bar is not None and self.over is not None:
            self.clearance[seen] = self.over.of(*poses, self.bar[None])

    def _contacts(self, k: int) -> None:
        data, contact = self.data, self.data.contact
        geom = contact.geom
        on_floor = np.flatnonzero((geom == self.floor).any(1))
        if not len(on_floor):
            return
        geom = geom[on_floor].sum(1) - self.floor
        pressed, force = np.zeros(len(on_floor)), np.zeros(6)
        for place in np.flatnonzero(self.foot_of_geom[geom] >= 0):
            mujoco.mj_contactForce(self.model, data, on_floor[place], force)
            pressed[place] = force[0]
        at, axes = contact.pos[on_floor], contact.frame[on_floor]
        self.contacts.append(
            (np.full(len(geom), k), geom, contact.dist[on_floor], at, axes, pressed)
        )

    def _loads(self) -> None:
        """Compute force, slip, touch and penetration from all contacts with the floor."""
        seen = slice(self.seen)
        self.foot_force[seen] = self.foot_slip[seen] = self.touch[seen] = self.penetration[seen] = 0
        if not self.contacts:
            return
        frame, geom, apart, at, axes, pressed = map(
            np.concatenate, zip(*self.contacts, strict=True)
        )
        np.maximum.at(self.penetration, frame, -apart)
        self.touch[frame[~self.may_touch[geom]]] = True
        body = self.model.geom_bodyid[geom]
        arm = at - self.subtree_com[frame, self.model.body_rootid[body]]
        velocity = _moving(self.cvel[frame, body], arm)
        first, second = np.moveaxis(axes.reshape(-1, 3, 3)[:, 1:], 1, 0)
        slip = np.hypot((velocity * first).sum(1), (velocity * second).sum(1))
        foot = self.foot_of_geom[geom]
        stands = foot >= 0
        where = frame[stands], foot[stands]
        np.add.at(self.foot_force, where, pressed[stands])
        np.add.at(self.foot_slip, where, (pressed * slip)[stands])
        carrying = self.foot_force > 0
        self.foot_slip[carrying] /= self.foot_force[carrying]


def _moving(cvel: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return world velocities [..., 3] of material points at arms [..., 3] m.

    Arms begin at the tree's centre of mass, the reference point of `cvel` [..., 6].
    """
    spin, slide = cvel[..., :3], cvel[..., 3:]
    # np.cross takes five times as long for so few points.
    turn = spin[..., [1, 2, 0]] * arm[..., [2, 0, 1]] - spin[..., [2, 0, 1]] * arm[..., [1, 2, 0]]
    return slide + turn
