"""How deep parts of a body stand in each other that are no neighbours.

MuJoCo's own collisions on the true shapes, those that are only for show among them.
Letters: `T` frames, `P` pairs of parts.
"""

import dataclasses
import itertools

import mujoco
import numpy as np

from mjxgait.creature import Creature

ONE_PLACE = 0.02
"""Hip heights within which the joints between two parts count as one, as a ball joint's three."""

FALSE = 2.0
"""Times the least way out that a contact is deep at most, and it may be at least; corners of boxes are up
to 1.4 times. Of two cylinders that cross MuJoCo may tell a depth as large as a radius where they hardly
touch, and of a disc in a box an eighth of the depth that there is."""

ONE_WAY = 0.01
"""rad by which axes may differ that count as parallel, about."""


@dataclasses.dataclass(frozen=True, eq=False)
class Overlaps:
    """The pairs of parts (bodies) that are ever deeper in each other than in the standing pose.

    pairs: their names, P. depth: [T, P] m more than when standing; NaN in frames that are NaN.
    """

    pairs: tuple[tuple[str, str], ...]
    depth: np.ndarray


def overlaps(creature: Creature, qpos: np.ndarray, excused: bool = True) -> Overlaps:
    """Looks at every frame of a motion; qpos: [T, nq]. excused: whether what is in each other when
    standing, as somebody has drawn it, counts only beyond that.
    """
    model = colliding_with_itself(creature)
    data = mujoco.MjData(model)
    usual = _depths(model, data, creature.stand_qpos) if excused else {}
    found: dict[tuple[int, int], np.ndarray] = {}
    finite = np.isfinite(qpos).all(1)
    for k in np.flatnonzero(finite):
        for geoms, depth in _depths(model, data, qpos[k]).items():
            more = depth - usual.get(geoms, 0.0)
            if more > 0:
                one, other = sorted(int(model.geom_bodyid[g]) for g in geoms)
                of_pair = found.setdefault((one, other), np.zeros(len(qpos)))
                of_pair[k] = max(of_pair[k], more)
    names = tuple((model.body(a).name, model.body(b).name) for a, b in found)
    depths = np.array(list(found.values())).reshape(len(found), len(qpos)).T
    return Overlaps(names, np.where(finite[:, None], depths, np.nan))


def colliding_with_itself(creature: Creature) -> mujoco.MjModel:
    """The body, every part of which collides with every other but its neighbours, and no floor."""
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
    """Pairs of bodies that one joint joins, or several at one place; those welded are one. And of
    two limbs of a body in a plane, whose axes are all parallel: they can only pass each other.

    MuJoCo leaves parent and child out by itself; they are listed all the same.
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
    """The bodies with joints from the root of the tree to this one."""
    chain = set()
    while body := int(model.body_weldid[body]):
        chain.add(body)
        body = int(model.body_parentid[body])
    return frozenset(chain)


def _depths(
    model: mujoco.MjModel, data: mujoco.MjData, qpos: np.ndarray
) -> dict[tuple[int, int], float]:
    """How deep each pair of geoms is in each other, m: as deep as the deepest contact, unless that
    is false.
    """
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
    """The least way out instead of a depth that it contradicts, m."""
    least = -mujoco.mj_geomDistance(model, data, *pair, model.stat.extent, None)
    believed = depth / FALSE <= least <= FALSE * depth
    return depth if believed or least <= 0 else least
