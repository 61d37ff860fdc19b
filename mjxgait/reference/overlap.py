"""Overlap of parts in recorded poses.

MuJoCo's collisions between the true shapes count, including visual-only geoms.
Letters: `T` frames, `P` pairs of parts.
"""

import dataclasses
import itertools

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.geometry import posed

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
        """Return the depth in m of each pair of geoms that overlap unusually in a pose [nq]."""
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
    MuJoCo excludes parent and child by itself; they are listed all the same. So are pairs with a
    part of an opponent: to touch it is no overlap, and its own overlap is not the creature's.
    """
    data = posed(model, creature.stand_qpos)
    chains = [_chain(model, body) for body in range(model.nbody)]
    own = model.body_rootid == model.body_rootid[creature.trunk]

    def joined(one: int, other: int) -> bool:
        between = chains[one] ^ chains[other]
        if len(between) < 2 or not (own[one] and own[other]):
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
