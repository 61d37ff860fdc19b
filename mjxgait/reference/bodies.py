"""Bodies simulated on C MuJoCo: arrays, observations, falls, water.

Water is written from docs/reference/modular-bodies.md. Letters: `S` simulations, `J` actuated
joints, `F` feet, `nq nv` as in MuJoCo, `B` blocks, `Q` points of a block's faces.
"""

from collections.abc import Collection

import mujoco
import numpy as np
from mujoco.batch import Batch

from mjxgait.creature import Creature
from mjxgait.creature.geometry import posed
from mjxgait.reference.contest import contest_of
from mjxgait.reference.layout import (
    Layout,
    LowestPoint,
    colliding_geoms,
    foot_middles,
    own_directions,
    per_foot,
    start_frame,
)
from mjxgait.reference.outcome import Fall
from mjxgait.reference.own_contact import OwnContact
from mjxgait.reference.starts import Starts, batch_of
from mjxgait.reference.state import FOOT_SENSES, OWN_CONTACT, State
from mjxgait.reference.terrain import terrain_of

PLACES = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
SHARES = np.array([5.0, 8.0, 5.0]) / 18
"""Gauss points on an edge from -1 to 1 and their weights: exact for this drag."""


class Water:
    """Drag along the normal of a face, against each point's velocity along it.

    drag: N·s/m³, force per area and velocity.
    """

    def __init__(self, model: mujoco.MjModel, drag: float) -> None:
        self.drag = drag
        box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        self.blocks = np.flatnonzero(box & (model.geom_bodyid > 0))
        self.bodies = model.geom_bodyid[self.blocks]
        self.roots = model.body_rootid[self.bodies]
        half = model.geom_size[self.blocks]
        points, normals, areas = [], [], []
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            for side in (-1.0, 1.0):
                for u, share_u in zip(PLACES, SHARES, strict=True):
                    for v, share_v in zip(PLACES, SHARES, strict=True):
                        place = np.zeros(3)
                        place[[axis, i, j]] = side, u, v
                        points.append(place * half)
                        normals.append(side * np.eye(3)[axis])
                        areas.append(4 * half[:, i] * half[:, j] * share_u * share_v)
        self.points = np.stack(points, axis=1)
        self.normals = np.stack(normals)
        self.areas = np.stack(areas, axis=1)

    def forces(
        self,
        geom_xpos: np.ndarray,
        geom_xmat: np.ndarray,
        cvel: np.ndarray,
        subtree_com: np.ndarray,
        xipos: np.ndarray,
    ) -> np.ndarray:
        """Return N, N·m [S, nbody, 6] about each body's centre of mass; arrays as in `MjData`."""
        count = len(geom_xpos)
        rotation = geom_xmat[:, self.blocks].reshape(count, -1, 3, 3)
        arms = np.einsum("sbij,bqj->sbqi", rotation, self.points)
        points = geom_xpos[:, self.blocks, None] + arms
        normals = np.einsum("sbij,qj->sbqi", rotation, self.normals)
        spin, shift = cvel[:, self.bodies, None, :3], cvel[:, self.bodies, None, 3:]
        # MuJoCo gives a body's velocity at the centre of mass of its whole tree.
        velocity = shift + np.cross(spin, points - subtree_com[:, self.roots, None])
        along = (velocity * normals).sum(3, keepdims=True)
        force = -self.drag * self.areas[:, :, None] * along * normals
        moment = np.cross(points - xipos[:, self.bodies, None], force)
        found = np.zeros((count, xipos.shape[1], 6))
        pushed = np.concatenate([force, moment], axis=3).sum(2)
        for block, body in enumerate(self.bodies):
            found[:, body] += pushed[:, block]
        return found


class Bath:
    """Water around simulations that are stepped together. drag: N·s/m³."""

    def __init__(self, model: mujoco.MjModel, batch: Batch, drag: float) -> None:
        self.water, self.force = Water(model, drag), batch.bind("xfrc_applied")
        names = ("geom_xpos", "geom_xmat", "cvel", "subtree_com", "xipos")
        self.seen = tuple(batch.bind(name) for name in names)

    def press(self, rows: np.ndarray) -> None:
        """Apply the water's force to some simulations, at their current velocities."""
        self.force[rows] = self.water.forces(*(array[rows] for array in self.seen))


VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)

BLOWN_UP = 1e4
"""m/s or rad/s at which a simulation stops: beyond any walk, and before MuJoCo writes warnings to a
log file.
"""


class Bodies:
    """Simulations at their initial conditions; on land each is raised out of the floor.

    reads: observations that the controller reads; others are not computed. drag: N·s/m³ of the
    water, 0 on land. threads: of the physics.
    """

    def __init__(
        self,
        creature: Creature,
        model: mujoco.MjModel,
        starts: Starts,
        reads: Collection[str],
        drag: float,
        threads: int = 1,
    ) -> None:
        self.creature, self.starts = creature, starts
        self.start, self.terrain = start_frame(creature), terrain_of(creature)
        self.contest = contest_of(creature)
        self.batch, self.layout = batch_of(creature, model, starts, threads), Layout(model)
        feet, watched = creature.feet, len(creature.feet.foot_of)
        self.solid = LowestPoint(model, colliding_geoms(model), self.terrain)
        self.feet = LowestPoint(model, feet.watched[:watched], self.terrain)
        self.forbidden = LowestPoint(model, feet.watched[watched:], self.terrain)
        bind = self.batch.bind
        self.qpos, self.qvel, self.applied = bind("qpos"), bind("qvel"), bind("qfrc_applied")
        self.warm_start = bind("qacc_warmstart")
        self.xpos, self.xmat, self.mass = bind("xpos"), bind("xmat"), bind("M")
        self.bias, self.passive = bind("qfrc_bias"), bind("qfrc_passive")
        self.constraint = bind("qfrc_constraint")
        self.geom_xpos, self.geom_xmat = bind("geom_xpos"), bind("geom_xmat")
        self.subtree_com = bind("subtree_com")
        # Constraint force of the previous step; the next step overwrites `constraint`.
        self.last_force = np.zeros_like(self.qvel)
        self.sees_feet = any(name in FOOT_SENSES for name in reads)
        self.sees_light = "light" in reads
        self.own = OwnContact(model, self.feet.geoms) if OWN_CONTACT in reads else None
        self.bath = Bath(model, self.batch, drag) if drag else None
        if self.bath is None:
            self._lift(model)
        self.batch.forward(stage=VELOCITY_STAGE)

    def step(self, rows: np.ndarray) -> None:
        """Advance the physics by one step, up to the velocity stage of the new state."""
        if self.bath:
            self.bath.press(rows)
        self.batch.step(rows, stage=VELOCITY_STAGE)

    def push(self, rows: np.ndarray) -> None:
        """Add each simulation's push to its velocity."""
        root = self.layout.root_dof
        self.qvel[rows, root : root + 2] += self.starts.push[rows]
        self.batch.forward(rows, stage=VELOCITY_STAGE)

    def follow(self, rows: np.ndarray, leader: int) -> None:
        """Copy the state of one simulation to others."""
        for state in (self.qpos, self.qvel, self.warm_start, self.last_force):
            state[rows] = state[leader]

    def state(self, rows: np.ndarray, step: int, goal: np.ndarray) -> State:
        """Return the state that a controller may observe at a control step.

        M and bias belong to the current state: each step ends with the velocity stage of the new
        one. goal: [rows] m ahead of the start.
        """
        creature, velocity = self.creature, self.qvel[rows]
        time = np.full(len(rows), step * creature.model.opt.timestep)
        rot, root = self.xmat[rows, creature.trunk].reshape(-1, 3, 3), self.layout.root_dof
        return State(
            start=self.start,
            ground=self.terrain,
            time=time,
            joint_pos=self.qpos[rows[:, None], creature.joints.qpos_adr],
            velocity=velocity,
            trunk_pos=self.xpos[rows, creature.trunk],
            trunk_rot=rot,
            trunk_vel=velocity[:, root : root + 3],
            # A free joint's angular velocity is in the body's own frame.
            trunk_angvel=(rot * velocity[:, None, root + 3 : root + 6]).sum(2),
            foot_height=self.foot_height(rows),
            foot_pos=self.foot_pos(rows),
            mass_matrix=self.layout.dense(self.mass[rows]),
            bias=self.bias[rows] - self.passive[rows],
            constraint_force=self.last_force[rows],
            light=self.light(rows, time),
            goal=goal,
            bar=self.starts.bar[rows, 0],
            own_gap=self.own_gap(rows),
        )

    def foot_height(self, rows: np.ndarray) -> np.ndarray:
        """Return heights [rows, F] in m above the floor; empty if unused."""
        if not self.sees_feet:
            return np.zeros((len(rows), 0))
        if self.bath:
            return np.full((len(rows), len(self.creature.feet.names)), np.inf)
        low = self.feet.heights(self.geom_xpos[rows], self.geom_xmat[rows])
        return per_foot(self.creature, low)

    def foot_pos(self, rows: np.ndarray) -> np.ndarray:
        """Return the middle [rows, F, 3] of each foot in m; empty if unused."""
        if not self.sees_feet:
            return np.zeros((len(rows), 0, 3))
        return foot_middles(self.creature, self.geom_xpos[rows])

    def own_gap(self, rows: np.ndarray) -> np.ndarray:
        """Return distances [rows, F] in m of blocks from others of the body; empty if unused."""
        if self.own is None:
            return np.zeros((len(rows), 0))
        return self.own.gaps(self.geom_xpos[rows], self.geom_xmat[rows])

    def light(self, rows: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Return the light's direction [rows, F, 3] in each foot's own axes; empty if unused.

        In a contest the cube is the light. time: [rows] s.
        """
        if not self.sees_light:
            return np.zeros((len(rows), 0, 3))
        if self.contest is not None:
            poses = self.geom_xpos[rows], self.geom_xmat[rows]
            return self.contest.to_cube(*poses, self.feet.geoms)
        starts, moved = self.starts, (time >= self.starts.light_time[rows])[:, None]
        light = np.where(moved, starts.moved_light[rows], starts.light[rows])[:, None]
        there = self.start.place + light - self.geom_xpos[rows][:, self.feet.geoms]
        there = np.where(light.any(2, keepdims=True), there, 0.0)
        return own_directions(there, self.geom_xmat[rows][:, self.feet.geoms])

    def travel(self, rows: np.ndarray) -> np.ndarray:
        """Return the way [rows, 3] from the start in m: forward, left, up."""
        moved = self.xpos[rows, self.creature.trunk] - self.start.place
        return np.stack([moved @ self.start.forward, moved @ self.start.left, moved[:, 2]], 1)

    def middle(self, rows: np.ndarray) -> np.ndarray:
        """Return the centre of mass [rows, 3] in m from the trunk's start, in world axes."""
        moved: np.ndarray = self.subtree_com[rows, self.creature.trunk] - self.start.place
        return moved

    def gaps(self, rows: np.ndarray) -> np.ndarray:
        """Return the distances [rows, 2] in m of body and opponent from the cube of a contest."""
        assert self.contest is not None
        return self.contest.gaps(self.geom_xpos[rows], self.geom_xmat[rows])

    def astray(self, rows: np.ndarray, commanded: np.ndarray) -> np.ndarray:
        """Return the nose's heading less the commanded one, [rows] rad."""
        rot = self.xmat[rows, self.creature.trunk].reshape(-1, 3, 3)
        nose = rot @ self.creature.frame.forward
        return wrapped(np.arctan2(nose @ self.start.left, nose @ self.start.forward) - commanded)

    def height(self, rows: np.ndarray) -> np.ndarray:
        """Return the height [rows] in m of the lowest part above the ground."""
        return self.solid.lowest(self.geom_xpos[rows], self.geom_xmat[rows])

    def sane(self, rows: np.ndarray) -> np.ndarray:
        """Return whether [rows] have not blown up; false for NaN."""
        return (np.abs(self.qvel[rows]) < BLOWN_UP).all(1)

    def down(self, rows: np.ndarray, fall: Fall) -> np.ndarray:
        """Return whether [rows] are down."""
        # Negated comparisons, so that NaN counts as down.
        trunk = self.creature.trunk
        up = self.xmat[rows, trunk].reshape(-1, 3, 3)[:, 2] @ self.creature.frame.up
        x, y, z = self.xpos[rows, trunk].T
        above = z - self.terrain.height(x, y) if self.terrain else z
        height = above / self.creature.frame.stand_height
        fine = (
            self.sane(rows)
            & (up > fall.min_up)
            & (height > fall.height[0])
            & (height < fall.height[1])
        )
        if fall.touch:
            fine &= self.forbidden.lowest(self.geom_xpos[rows], self.geom_xmat[rows]) > 0
        return ~fine

    def _lift(self, model: mujoco.MjModel) -> None:
        """Raise each body until no part is deeper in the floor than when standing.

        Otherwise joint noise would begin with a kick.
        """
        self.batch.forward(stage=VELOCITY_STAGE)
        standing = posed(model, self.creature.stand_qpos)
        usual = self.solid.lowest(standing.geom_xpos[None], standing.geom_xmat[None])
        self.qpos[:, self.layout.root_qpos + 2] += np.maximum(
            usual - self.solid.lowest(self.geom_xpos, self.geom_xmat), 0
        )


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Wrap angles in rad to -pi to pi."""
    turned: np.ndarray = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    return turned
