"""Measurements of recorded frames: places of parts, floor contact, overlap, grown bodies.

Overlap uses MuJoCo's collisions between the true shapes, including visual-only geoms. Quantities
that need no MuJoCo call per frame are computed for all frames at the end.
Letters: `T` frames, `P` pairs of parts.
"""

import dataclasses
import itertools
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.reference.layout import Clearance, LowestPoint, per_foot
from mjxgait.reference.stepping import examined_model
from mjxgait.reference.terrain import terrain_of

ONE_PLACE = 0.02
"""Hip heights within which joints between two parts count as one, as the three of a ball joint."""

FALSE = 2.0
"""Largest credible ratio of contact depth to least way out, or inverse; box corners reach 1.4.

MuJoCo may report a whole radius for crossed cylinders that hardly touch, and an eighth of the true
depth for a disc in a box."""

ONE_WAY = 0.01
"""Largest difference between parallel axes, about in rad."""


@dataclasses.dataclass(frozen=True, eq=False)
class Overlaps:
    """Pairs of parts (bodies) that ever overlap more deeply than in the standing pose.

    pairs: names, P. depth: [T, P] m beyond the standing pose; NaN in frames that are NaN.
    """

    pairs: tuple[tuple[str, str], ...]
    depth: np.ndarray


def overlaps(creature: Creature, qpos: np.ndarray, excused: bool = True) -> Overlaps:
    """Measure the overlaps in every frame of a motion; qpos: [T, nq].

    excused: whether the overlap of the standing pose, part of the model as drawn, is subtracted.
    """
    pairs = PartOverlap(creature, excused)
    found: dict[tuple[int, int], np.ndarray] = {}
    finite = np.isfinite(qpos).all(1)
    for k in np.flatnonzero(finite):
        for geoms, more in pairs.depths(qpos[k]).items():
            one, other = sorted(int(pairs.model.geom_bodyid[g]) for g in geoms)
            of_pair = found.setdefault((one, other), np.zeros(len(qpos)))
            of_pair[k] = max(of_pair[k], more)
    model = pairs.model
    names = tuple((model.body(a).name, model.body(b).name) for a, b in found)
    depths = np.array(list(found.values())).reshape(len(found), len(qpos)).T
    return Overlaps(names, np.where(finite[:, None], depths, np.nan))


class PartOverlap:
    """Overlap of a creature's parts, pose by pose; see `overlaps`."""

    def __init__(self, creature: Creature, excused: bool = True) -> None:
        self.model = colliding_with_itself(creature)
        self._data = mujoco.MjData(self.model)
        self._usual = _depths(self.model, self._data, creature.stand_qpos) if excused else {}

    def depths(self, qpos: np.ndarray) -> dict[tuple[int, int], float]:
        """Return the depth in m of each pair of geoms that overlap in a pose [nq] more than usual."""
        found = _depths(self.model, self._data, qpos)
        more = {geoms: depth - self._usual.get(geoms, 0.0) for geoms, depth in found.items()}
        return {geoms: depth for geoms, depth in more.items() if depth > 0}

    def deepest(self, qpos: np.ndarray) -> float:
        """Return the largest depth in m in a pose [nq]; 0 if no parts overlap."""
        return max(self.depths(qpos).values(), default=0.0)


def colliding_with_itself(creature: Creature) -> mujoco.MjModel:
    """Return a model without floor in which all parts but neighbours collide."""
    spec = mujoco.MjSpec.from_string(creature.files["creature.xml"])
    for stated in (*spec.excludes, *spec.pairs):
        spec.delete(stated)
    for body in spec.bodies:
        body.name = body.name or f"body {body.id}"
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = int(geom.parent.name != "world")
        geom.margin = geom.gap = 0.0
    for a, b in neighbours(spec.compile(), creature):
        spec.add_exclude(bodyname1=spec.bodies[a].name, bodyname2=spec.bodies[b].name)
    return spec.compile()


def neighbours(model: mujoco.MjModel, creature: Creature) -> list[tuple[int, int]]:
    """Return pairs of bodies joined by one joint or by several at one place; welded bodies are one.

    In a planar body, pairs of limbs with parallel axes are included: they can only pass each other.
    MuJoCo excludes parent and child by itself; they are listed all the same.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_kinematics(model, data)
    chains = [_chain(model, body) for body in range(model.nbody)]

    def joined(one: int, other: int) -> bool:
        between = chains[one] ^ chains[other]
        if len(between) < 2:
            return True
        joints = np.isin(model.jnt_bodyid, list(between))
        reach = np.linalg.norm(np.ptp(data.xanchor[joints], axis=0))
        if reach <= ONE_PLACE * creature.frame.hip_height:
            return True
        both = between - chains[one] and between - chains[other]
        passing = creature.settings.creature.planar and both
        return bool(passing) and np.linalg.matrix_rank(data.xaxis[joints], tol=ONE_WAY) == 1

    moving = range(1, model.nbody)
    return [(a, b) for a, b in itertools.combinations(moving, 2) if joined(a, b)]


def _chain(model: mujoco.MjModel, body: int) -> frozenset[int]:
    """Return the bodies with joints from the root of the tree to this one."""
    chain = set()
    while body := int(model.body_weldid[body]):
        chain.add(body)
        body = int(model.body_parentid[body])
    return frozenset(chain)


def _depths(
    model: mujoco.MjModel, data: mujoco.MjData, qpos: np.ndarray
) -> dict[tuple[int, int], float]:
    """Return the overlap depth of each pair of geoms in m: of the deepest contact, unless false."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    depths: dict[tuple[int, int], float] = {}
    for (a, b), distance in zip(
        data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True
    ):
        depths[a, b] = max(depths.get((a, b), 0.0), -distance)
    return {pair: _true(model, data, pair, depth) for pair, depth in depths.items()}


def _true(model: mujoco.MjModel, data: mujoco.MjData, pair: tuple[int, int], depth: float) -> float:
    """Return the depth in m, or the least way out if that contradicts it."""
    least = -mujoco.mj_geomDistance(model, data, *pair, model.stat.extent, None)
    believed = depth / FALSE <= least <= FALSE * depth
    return depth if believed or least <= 0 else least


@dataclasses.dataclass(frozen=True, eq=False)
class Grown:
    """Measurements of a modular body, in world axes.

    middle: [T, 3] m, centre of mass. momentum: [T, 3] N·s. push: [T, 3] N, total water force.
    low: [T] m, lowest point of all blocks. buried: [T] greatest depth of a block in the ground, as
    a share of its size. folded: [T] greatest depth of a block's far end in the block on which it
    turns, as a share of the smaller size. sizes: m by name of the part, cube root of its volume.
    """

    middle: np.ndarray
    momentum: np.ndarray
    push: np.ndarray
    low: np.ndarray
    buried: np.ndarray
    folded: np.ndarray
    sizes: Mapping[str, float]

    def window(self, frames: slice) -> "Grown":
        """Return some of the frames."""
        arrays = {
            f.name: getattr(self, f.name)[frames]
            for f in dataclasses.fields(self)
            if f.name != "sizes"
        }
        return Grown(**arrays, sizes=self.sizes)


def seen_grown(creature: Creature, qpos: np.ndarray, qvel: np.ndarray, drag: float) -> Grown:
    """Measure a motion [T, nq], [T, nv]; frames after it blew up are NaN.

    drag: N·s/m³ of the water; 0 without. The velocity of a block's middle along the normal gives
    the force on a face (docs/reference/modular-bodies.md); the reference simulator sums points
    instead.
    """
    model, data = creature.model, mujoco.MjData(creature.model)
    boxes = np.flatnonzero(model.geom_bodyid > 0)
    half, size = model.geom_size[boxes], np.cbrt(8 * model.geom_size[boxes].prod(1))
    middle, momentum, push = (np.full((len(qpos), 3), np.nan) for _ in range(3))
    low, buried, folded = (np.full(len(qpos), np.nan) for _ in range(3))
    joined = _joined(model, boxes)
    velocity = np.zeros(6)
    for k in np.flatnonzero(np.isfinite(qpos).all(1) & np.isfinite(qvel).all(1)):
        data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        momentum[k] = push[k] = 0.0
        for box in boxes:
            kind, mass = mujoco.mjtObj.mjOBJ_GEOM, model.body_mass[model.geom_bodyid[box]]
            mujoco.mj_objectVelocity(model, data, kind, box, velocity, 0)
            momentum[k] += mass * velocity[3:]
            push[k] += _push(model.geom_size[box], data.geom_xmat[box], velocity[3:], drag)
        middle[k] = data.subtree_com[creature.trunk]
        reach = (np.abs(data.geom_xmat[boxes, 6:]) * half).sum(1)
        lows = data.geom_xpos[boxes, 2] - reach
        low[k], buried[k] = lows.min(), (-lows / size).max()
        ends = _far_ends(data, model, boxes)
        folded[k] = max(
            (_depth(data, model, ends[i], boxes[j]) / min(size[i], size[j]) for i, j in joined),
            default=0.0,
        )
    names = [model.body(model.geom_bodyid[box]).name for box in boxes]
    sizes = dict(zip(names, size.tolist(), strict=True))
    buried, folded = np.maximum(buried, 0.0), np.maximum(folded, 0.0)
    return Grown(middle, momentum, push, low, buried, folded, sizes)


def _joined(model: mujoco.MjModel, boxes: np.ndarray) -> list[tuple[int, int]]:
    """Places in `boxes` of a block and one further in, for pairs with a single joint between."""
    place = {int(model.geom_bodyid[box]): i for i, box in enumerate(boxes)}
    found = []
    for body, i in place.items():
        joints, above = 0, body
        while above in place and joints < 2:
            joints += int(model.body_jntnum[above] > 0)
            above = int(model.body_parentid[above])
            if joints == 1 and above in place:
                found.append((i, place[above]))
    return found


def _far_ends(data: mujoco.MjData, model: mujoco.MjModel, boxes: np.ndarray) -> np.ndarray:
    """Points [G, 3] m of the blocks that are farthest from their joints, along their middles."""
    ends: np.ndarray = 2 * data.geom_xpos[boxes] - data.xpos[model.geom_bodyid[boxes]]
    return ends


def _depth(data: mujoco.MjData, model: mujoco.MjModel, point: np.ndarray, box: int) -> float:
    """Depth in m of a point in a box; negative outside."""
    inward = (point - data.geom_xpos[box]) @ data.geom_xmat[box].reshape(3, 3)
    return float((model.geom_size[box] - np.abs(inward)).min())


def _push(half: np.ndarray, rotation: np.ndarray, velocity: np.ndarray, drag: float) -> np.ndarray:
    """Return the force [3] in N on a block with this velocity of its middle."""
    normals = rotation.reshape(3, 3)
    # Each area is that of two opposite faces.
    areas = 8 * half[[1, 2, 0]] * half[[2, 0, 1]]
    pushed: np.ndarray = -drag * normals @ (areas * (velocity @ normals))
    return pushed


class Sight:
    """Reader of frames from an MjData; a frame not read is NaN (`touch`: true)."""

    def __init__(self, creature: Creature, frames: int, bar: np.ndarray | None) -> None:
        self.creature, self.model = creature, examined_model(creature)
        self.data = mujoco.MjData(self.model)
        feet = len(creature.feet.names)
        foot_geoms = creature.feet.watched[: len(creature.feet.foot_of)]
        self.reach = LowestPoint(self.model, foot_geoms, terrain_of(creature))
        self.foot_of_geom = np.full(self.model.ngeom, -1)
        self.foot_of_geom[foot_geoms] = creature.feet.foot_of
        self.may_touch = np.isin(np.arange(self.model.ngeom), [*foot_geoms, *creature.feet.ground])
        self.floor = self.model.geom("floor").id
        self.trunk_pos, self.trunk_rot = (
            np.full((frames, 3), np.nan),
            np.full((frames, 3, 3), np.nan),
        )
        self.foot_force, self.foot_slip, self.foot_height = (
            np.full((frames, feet), np.nan) for _ in range(3)
        )
        self.bar, self.over = bar, None if bar is None else Clearance(creature)
        self.clearance = np.full(frames, np.nan)
        # Kept for `finish`, which handles all frames at once.
        model, self.seen = self.model, 0
        self.geom_xpos, self.geom_xmat = (
            np.empty((frames, model.ngeom, 3)),
            np.empty((frames, model.ngeom, 9)),
        )
        self.spun = np.empty((frames, model.nbody, 6))
        self.inertial, self.middle = (np.empty((frames, model.nbody, 3)) for _ in range(2))
        self.met: list[tuple[np.ndarray, ...]] = []
        self.touch, self.penetration, self.body_speed = (
            np.ones(frames, bool),
            np.full(frames, np.nan),
            np.full(frames, np.nan),
        )

    def look(self, k: int, qpos: np.ndarray, qvel: np.ndarray, torque: np.ndarray) -> None:
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
        self.spun[k] = data.cvel
        self.inertial[k], self.middle[k] = data.xipos, data.subtree_com
        self._contacts(k)
        self.seen = k + 1

    def finish(self) -> None:
        """Compute what follows from the poses and contacts of all frames read."""
        seen = slice(self.seen)
        poses = self.geom_xpos[seen], self.geom_xmat[seen]
        self.foot_height[seen] = per_foot(self.creature, self.reach.heights(*poses))
        arm = self.inertial[seen] - self.middle[seen][:, self.model.body_rootid]
        speed = np.linalg.norm(_moving(self.spun[seen], arm)[:, 1:], axis=2)
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
        self.met.append((np.full(len(geom), k), geom, contact.dist[on_floor], at, axes, pressed))

    def _loads(self) -> None:
        """Compute force, slip, touch and penetration from all contacts with the floor."""
        seen = slice(self.seen)
        self.foot_force[seen] = self.foot_slip[seen] = self.touch[seen] = self.penetration[seen] = 0
        if not self.met:
            return
        frame, geom, apart, at, axes, pressed = map(np.concatenate, zip(*self.met, strict=True))
        np.maximum.at(self.penetration, frame, -apart)
        self.touch[frame[~self.may_touch[geom]]] = True
        body = self.model.geom_bodyid[geom]
        arm = at - self.middle[frame, self.model.body_rootid[body]]
        velocity = _moving(self.spun[frame, body], arm)
        first, second = np.moveaxis(axes.reshape(-1, 3, 3)[:, 1:], 1, 0)
        slip = np.hypot((velocity * first).sum(1), (velocity * second).sum(1))
        foot = self.foot_of_geom[geom]
        stands = foot >= 0
        where = frame[stands], foot[stands]
        np.add.at(self.foot_force, where, pressed[stands])
        np.add.at(self.foot_slip, where, (pressed * slip)[stands])
        carrying = self.foot_force > 0
        self.foot_slip[carrying] /= self.foot_force[carrying]


def _moving(spun: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return world velocities [..., 3] of material points at arms [..., 3] m.

    Arms begin at the tree's centre of mass, the reference point of `cvel` [..., 6].
    """
    spin, slide = spun[..., :3], spun[..., 3:]
    # np.cross takes five times as long for so few points.
    turn = spin[..., [1, 2, 0]] * arm[..., [2, 0, 1]] - spin[..., [2, 0, 1]] * arm[..., [1, 2, 0]]
    return slide + turn
