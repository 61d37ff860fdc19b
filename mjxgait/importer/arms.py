"""Arms of a figure on two legs, in a model file: they hang, and their shoulders swing.

A file's zero pose often spreads the arms or holds them ahead. Skeletons: see `rig_arms`.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature.geometry import ancestors, posed, subtree
from mjxgait.importer.anatomy import HINGE, Anatomy, in_plane
from mjxgait.importer.legs import descended, limits_around

SHOULDER = 3
"""Most hinges of a shoulder."""
BESIDE = 0.5
"""Least distance of a shoulder from the middle, over that of a hip."""
LONG = 0.25
"""Least length of an arm, in hip heights."""
LEVEL = 0.1
"""Most difference of the two shoulders' heights, in hip heights."""
BEND, TURN = 0.05, 0.003
"""Resistance of an elbow, which rests a little bent, and of the shoulder to hanging."""
TILTS = np.radians([0.0, 8.0, 16.0, 24.0, 32.0, 40.0])
"""Angles from the vertical, outwards, of a hanging arm, tried until it is clear of the rest."""
CLEAR, UPPER = 0.01, 0.3
"""Least distance of an arm from the rest, in shoulder heights; share of its length, from the
shoulder on, that may touch."""
SIDEWAYS = 0.3
"""Most share of a shoulder's motion that is not ahead or back."""
FAST = 1.2
"""Most rad that the hinges of a shoulder turn, for one that the arm swings."""


@dataclasses.dataclass(frozen=True)
class Arm:
    """An arm.

    bodies: of the file, from the shoulder on. hinges: joint ids, from the shoulder to where the arm
    branches. side: [3] unit vector outwards.
    """

    bodies: tuple[int, ...]
    hinges: tuple[int, ...]
    side: np.ndarray


def arms_of(model: mujoco.MjModel, anatomy: Anatomy, movable: Sequence[int]) -> list[Arm]:
    """Return the two arms of a figure on two legs; nothing for other bodies."""
    if len(anatomy.feet) != 2 or in_plane(model, anatomy.root):
        return []
    hinged = {int(model.jnt_bodyid[j]) for j in movable if int(model.jnt_type[j]) == HINGE}
    first = _hips(model, anatomy, hinged)
    if len(first) != 2:
        return []
    hips = anatomy.xpos[first]
    middle, across = hips.mean(0), (hips[0] - hips[1]) * [1, 1, 0]
    wide, floor = float(np.linalg.norm(across)), anatomy.low(anatomy.bodies)
    if wide < 1e-6:
        return []
    high, side = float(middle[2]) - floor, across / wide

    def beside(body: int) -> float:
        return float((anatomy.xpos[body] - middle) @ side)

    found: list[Arm] = []
    for b in sorted(hinged - {b for foot in anatomy.feet for b in ancestors(model, foot)}):
        inside = subtree(model, b)
        reach = np.linalg.norm(anatomy.xpos[inside] - anatomy.xpos[b], axis=1).max()
        begins = not any(b in arm.bodies for arm in found)
        if (
            begins
            and abs(beside(b)) > BESIDE * wide / 2
            and anatomy.xpos[b][2] > middle[2]
            and reach > LONG * high
        ):
            outwards = np.sign(beside(b)) * side
            found.append(Arm(tuple(inside), _chain(model, b, movable), outwards))
    if len(found) != 2 or found[0].side @ found[1].side > 0:
        return []
    shoulders = [anatomy.xpos[arm.bodies[0]][2] for arm in found]
    return found if abs(shoulders[0] - shoulders[1]) < LEVEL * high else []


def _hips(model: mujoco.MjModel, anatomy: Anatomy, hinged: set[int]) -> list[int]:
    """First body of each leg that turns by a hinge and carries no other leg, if it has one."""
    legs = [[b for b in reversed(ancestors(model, foot)) if b in hinged] for foot in anatomy.feet]
    shared = set(legs[0]) & set(legs[1])
    own = [[b for b in leg if b not in shared] for leg in legs]
    return [leg[0] for leg in own if leg]


def _chain(model: mujoco.MjModel, body: int, movable: Sequence[int]) -> tuple[int, ...]:
    """Hinges from a body on, down to where the limb branches."""
    found: list[int] = []
    while True:
        found += [j for j in movable if int(model.jnt_bodyid[j]) == body]
        below = [int(b) for b in np.flatnonzero(model.body_parentid == body)]
        further = [b for b in below if any(model.body_jntnum[i] for i in subtree(model, b))]
        if len(further) != 1:
            return tuple(j for j in found if int(model.jnt_type[j]) == HINGE)
        body = further[0]


def hung(model: mujoco.MjModel, anatomy: Anatomy, arms: Sequence[Arm]) -> np.ndarray:
    """Return the pose [nq] of the anatomy with arms that hang, clear of trunk and legs."""
    data = posed(model, anatomy.qpos)
    turn = anatomy.turn(data)
    high = anatomy.xpos[arms[0].bodies[0]][2] - anatomy.low(anatomy.bodies)
    for arm in arms:
        adr = model.jnt_qposadr[list(arm.hinges)]
        start = data.qpos[adr].copy()
        for tilt in TILTS:
            down = turn.T @ (np.sin(tilt) * arm.side - np.cos(tilt) * np.array([0.0, 0.0, 1.0]))
            data.qpos[adr] = _lowest(model, data, arm, down, start)
            mujoco.mj_kinematics(model, data)
            if _clear(model, data, anatomy, arm, CLEAR * high / anatomy.scale):
                break
    found: np.ndarray = data.qpos.copy()
    return found


def _lowest(
    model: mujoco.MjModel, data: mujoco.MjData, arm: Arm, down: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Return the angles [J] of an arm's hinges that let it hang.

    data: is changed. down: [3] unit vector in the file's world. start: [J] angles at which its
    elbow would rest.
    """
    adr, shoulder = model.jnt_qposadr[list(arm.hinges)], arm.bodies[0]
    data.qpos[adr] = start
    mujoco.mj_kinematics(model, data)
    away = _away(data, arm)
    below = [away[arm.bodies.index(int(model.jnt_bodyid[j]))] > UPPER for j in arm.hinges]
    stiff, length = np.where(below, BEND, TURN), _length(data, arm)

    def height(q: np.ndarray) -> float:
        data.qpos[adr] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        hangs = (data.subtree_com[shoulder] - data.xpos[shoulder]) @ down
        return float(stiff @ np.square(q - start) - hangs / length)

    return descended(height, start, *limits_around(model, list(arm.hinges), start))


def _length(data: mujoco.MjData, arm: Arm) -> float:
    """Greatest distance of a body of an arm from the shoulder, in the file's unit."""
    places = data.xpos[list(arm.bodies)]
    return float(np.linalg.norm(places - places[0], axis=1).max())


def _away(data: mujoco.MjData, arm: Arm) -> np.ndarray:
    """Distance of each body of an arm [bodies] from the shoulder, over the greatest."""
    places = data.xpos[list(arm.bodies)]
    found: np.ndarray = np.linalg.norm(places - places[0], axis=1) / _length(data, arm)
    return found


def _clear(
    model: mujoco.MjModel, data: mujoco.MjData, anatomy: Anatomy, arm: Arm, near: float
) -> bool:
    """Return whether the arm's shapes keep a distance from those of the other parts."""
    lower = {b for b, far in zip(arm.bodies, _away(data, arm), strict=True) if far > UPPER}
    others = set(anatomy.bodies) - set(arm.bodies)
    body = model.geom_bodyid
    own = [g for g in range(model.ngeom) if int(body[g]) in lower]
    rest = [g for g in range(model.ngeom) if int(body[g]) in others]
    return all(
        mujoco.mj_geomDistance(model, data, g, other, 2 * near, None) > near
        for g, other in itertools.product(own, rest)
    )


def shoulder_of(
    model: mujoco.MjModel, anatomy: Anatomy, qpos: np.ndarray, arm: Arm
) -> tuple[int, ...]:
    """Return the hinges by which an arm swings ahead and back in a pose [nq]; none if it cannot.

    The fewest of the first `SHOULDER`, with all others of the same bodies.
    """
    data = posed(model, qpos)
    mujoco.mj_comPos(model, data)
    turn = anatomy.turn(data)
    along = turn @ (data.subtree_com[arm.bodies[0]] - data.xpos[arm.bodies[0]])
    first = arm.hinges[:SHOULDER]
    for count in range(1, len(first) + 1):
        for chosen in itertools.combinations(first, count):
            bodies = {int(model.jnt_bodyid[j]) for j in chosen}
            whole = tuple(j for j in arm.hinges if int(model.jnt_bodyid[j]) in bodies)
            turns, missed = ratios(data.xaxis[list(whole)] @ turn.T, along, arm.side)
            if missed < SIDEWAYS and np.linalg.norm(turns) < FAST:
                return whole
    return ()


def ratios(axes: np.ndarray, along: np.ndarray, about: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the turns [J] of hinges that together swing an arm about an axis, and what is missed.

    Args:
      axes: [J, 3] of the hinges. along: [3] from the shoulder to the arm's centre of mass; turns
        about it do not move the arm. about: [3] unit vector.

    Returns:
      ratios: [J] rad per rad. missed: share of the swing that these hinges cannot make.
    """
    way = along / np.linalg.norm(along)
    seen = np.eye(3) - np.outer(way, way)
    found = np.linalg.lstsq(seen @ axes.T, seen @ about, rcond=1e-3)[0]
    missed = np.linalg.norm(seen @ (axes.T @ found - about))
    return found, float(missed)
