"""Joints of a compiled model that could move, and limbs that are legs."""

import re
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from mjxgait.creature.geometry import ancestors, posed, subtree
from mjxgait.errors import UserError, listed, matches
from mjxgait.importer.anatomy import FREE, HINGE, SLIDE, Anatomy
from mjxgait.importer.notes import Notes
from mjxgait.importer.shapes import Shape

SAME_LEVEL = 0.2
"""Share of the creature's height: limbs that end this close to the lowest point are legs."""

NO_LEGS = re.compile(
    "(?<![a-z])(wing|haltere|antenna|mouth|jaw|mandible|proboscis|rostrum|haustellum|labrum|palp)"
)
"""Name parts of limbs that no animal walks on, however low they hang."""

DRAWS, STEPS, TINY = 300, (0.3, 0.1, 0.03, 0.01, 0.003, 0.001), 1e-5
"""Lowering of a limb: random poses tried; rad by which each joint then moves; m to gain by that."""


class NoLegs(UserError):
    """No limb reaches the floor in this pose."""


def movable_joints(
    model: mujoco.MjModel,
    anatomy: Anatomy,
    coupled: Sequence[str],
    freeze: Sequence[str],
    notes: Notes,
) -> list[int]:
    """Joints that could be active; frozen ones are reported."""
    joints, slides, frozen = [], [], []
    followers = _followers(model)
    for j in range(model.njnt):
        name, kind = model.joint(j).name, int(model.jnt_type[j])
        if model.jnt_bodyid[j] not in anatomy.bodies or model.jnt_bodyid[j] == anatomy.root:
            continue
        if kind == SLIDE:
            slides.append(name or f"joint {j}")
        elif matches(name, freeze):
            frozen.append(name)
        elif name not in coupled and j not in followers and kind != FREE:
            joints.append(j)
    if slides:
        notes.change(
            f"slide joints {listed(slides)} frozen",
            "the controller's key poses are angles; a sliding limb keeps its length",
        )
    if frozen:
        notes.change(f"joints {listed(frozen)} frozen", "as given by --freeze")
    if followers:
        notes.change(
            f"joints {listed([model.joint(j).name for j in sorted(followers)])} frozen",
            "they follow other joints (equality)",
        )
    return joints


def _followers(model: mujoco.MjModel) -> set[int]:
    return {
        int(model.eq_obj1id[e])
        for e in range(model.neq)
        if int(model.eq_type[e]) == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj1id[e] >= 0
    }


def find_feet(
    model: mujoco.MjModel,
    anatomy: Anatomy,
    movable: list[int],
    limbs: frozenset[str] | None = None,
) -> list[int]:
    """Return the last moving bodies of the limbs that reach the floor. limbs: see `Source`."""
    movers = {int(model.jnt_bodyid[j]) for j in movable}
    if not movers:
        raise UserError(
            f'"{model.body(anatomy.root).name}" has no hinge joint below it, so it has no legs; a '
            "creature needs legs with hinges"
        )
    segments: dict[int, list[int]] = {}
    for b in anatomy.bodies:
        segments.setdefault(_segment(model, b, movers), []).append(b)
    ends = _ends(model, movers)
    floor = min(anatomy.low(inside) for inside in segments.values())
    top = max(float(anatomy.xpos[b][2]) for b in anatomy.bodies)
    span = float(np.ptp(anatomy.xpos[anatomy.bodies], axis=0).max())
    height = max(top - floor, 0.1 * span, 1e-6)
    ends = _without_toes(model, anatomy, ends, movers)
    ends = [b for b in ends if not _named_otherwise(model, b, movers)] or ends
    ends = [b for b in ends if limbs is None or model.body(b).name in limbs] or ends
    feet = sorted(b for b in ends if anatomy.low(subtree(model, b)) <= floor + SAME_LEVEL * height)
    if not feet:
        lowest = min(ends, key=lambda b: anatomy.low(subtree(model, b)))
        raise NoLegs(
            f'no limb reaches the floor: "{model.body(anatomy.root).name}" itself lies lowest, the '
            f'lowest limb "{model.body(lowest).name}" '
            "ends above it, so this has no legs to walk on; if the file lies on its side, say --up"
        )
    wheels = [b for b in feet if _is_wheel(model, anatomy, b)]
    if len(wheels) == len(feet):
        raise UserError(
            f'"{model.body(wheels[0]).name}" is a wheel, as are all parts on the floor; a creature '
            "needs legs that step"
        )
    return [b for b in feet if b not in wheels]


def _named_otherwise(model: mujoco.MjModel, end: int, movers: set[int]) -> bool:
    """Return whether a limb's name says that it is no leg."""
    names = [model.body(b).name.lower() for b in ancestors(model, end) if b in movers]
    return any(NO_LEGS.search(name) for name in names)


def _segment(model: mujoco.MjModel, body: int, movers: set[int]) -> int:
    """Return the nearest body up the tree, itself included, with an active joint; else -1."""
    for b in ancestors(model, body):
        if b in movers:
            return b
    return -1


def _ends(model: mujoco.MjModel, movers: set[int]) -> list[int]:
    """Moving bodies without another one below."""
    return [b for b in movers if movers.isdisjoint(subtree(model, b)[1:])]


def lowered_limbs(model: mujoco.MjModel, anatomy: Anatomy, movable: list[int]) -> np.ndarray:
    """Pose [nq] with each limb as low as possible.

    Used for files with folded or stretched legs in their zero pose.
    """
    data, rng = posed(model, anatomy.qpos), np.random.default_rng(0)
    up = anatomy.turn(data)
    movers = {int(model.jnt_bodyid[j]) for j in movable}
    for end in _ends(model, movers):
        joints = [
            j
            for j in movable
            if int(model.jnt_bodyid[j]) in ancestors(model, end) and int(model.jnt_type[j]) == HINGE
        ]
        adr = model.jnt_qposadr[joints]
        low, high = limits_around(model, joints, data.qpos[adr])
        clouds = [(b, s) for b in subtree(model, end) for s in anatomy.shapes[b]]

        def height(
            q: np.ndarray,
            end: int = end,
            adr: np.ndarray = adr,
            clouds: list[tuple[int, Shape]] = clouds,
        ) -> float:
            data.qpos[adr] = q
            mujoco.mj_kinematics(model, data)
            points = [
                data.xpos[b] + (s.points / anatomy.scale) @ data.xmat[b].reshape(3, 3).T
                for b, s in clouds
            ] or [data.xpos[[end]]]
            return float((np.concatenate(points) @ up.T)[:, 2].min())

        best = min((rng.uniform(low, high) for _ in range(DRAWS)), key=height)
        data.qpos[adr] = descended(height, best, low, high)
    return data.qpos.copy()


def limits_around(
    model: mujoco.MjModel, joints: list[int], q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds [J] in rad of the joint search around the current pose."""
    limits = np.array(
        [
            model.jnt_range[j] if model.jnt_range[j][0] < model.jnt_range[j][1] else (-1.6, 1.6)
            for j in joints
        ]
    ).reshape(-1, 2)
    ends = np.maximum(limits[:, 0], q - 2.0), np.minimum(limits[:, 1], q + 2.0)
    return np.minimum(*ends), np.maximum(*ends)


def descended(
    height: Callable[[np.ndarray], float], q: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Descend from `q` to a pose [J] that no single joint can lower: alike legs end alike."""
    lowest = height(q)
    for step in STEPS:
        moved = True
        while moved:
            moved = False
            for way in step * np.concatenate([np.eye(len(q)), -np.eye(len(q))]):
                tried = np.clip(q + way, low, high)
                if (found := height(tried)) < lowest - TINY:
                    q, lowest, moved = tried, found, True
    return q


def _without_toes(
    model: mujoco.MjModel, anatomy: Anatomy, ends: list[int], movers: set[int]
) -> list[int]:
    """Replace ends that branch off one moving body near each other (toes, fingers) by that body."""
    span = max(float(np.ptp(anatomy.xpos[anatomy.bodies], axis=0).max()), 1e-6)
    result: list[int] = []
    for end in ends:
        parent = _segment(model, int(model.body_parentid[end]), movers)
        brothers = [e for e in ends if parent > 0 and parent in ancestors(model, e)]
        near = len(brothers) > 1 and np.ptp(anatomy.xpos[brothers], axis=0).max() < 0.1 * span
        chosen = parent if near else end
        if chosen not in result:
            result.append(chosen)
    return result


def _is_wheel(model: mujoco.MjModel, anatomy: Anatomy, body: int) -> bool:
    """Return whether the body is a round part on an unlimited hinge through its middle."""
    start = int(model.body_jntadr[body])
    if model.body_jntnum[body] != 1 or model.jnt_limited[start]:
        return False
    axis, anchor = model.jnt_axis[start], model.jnt_pos[start] * anatomy.scale
    clouds = [s.points for s in anatomy.shapes[body] if s.solid or s.seen]
    if not clouds:
        return False
    points = np.concatenate(clouds) - anchor
    away = np.linalg.norm(points - np.outer(points @ axis, axis), axis=1)
    centre = np.linalg.norm((points - np.outer(points @ axis, axis)).mean(0))
    return bool(away.max() > 0 and centre < 0.1 * away.max() and len(points) > 2)
