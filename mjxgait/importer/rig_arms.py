"""Arms of an upright figure: a skeleton rests with arms spread, and the body lets them hang."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import Rig
from mjxgait.importer.rig import Plan
from mjxgait.importer.rig_radii import points_along, radii_of

HANGS = np.radians(30.0)
"""Angle from the vertical within which an arm hangs already."""
TILTS = np.radians([8.0, 16.0, 24.0, 32.0, 40.0])
"""Angles from the vertical, outwards, that are tried until the arm is clear of trunk and legs."""


def hanging(plan: Plan) -> tuple[Rig, dict[int, np.ndarray]]:
    """Return the skeleton with hanging arms, and the rotation [3, 3] of each arm by its upper bone."""
    rig, radii = plan.rig, radii_of(plan)
    turns: dict[int, np.ndarray] = {}
    for bone, *_ in plan.arms:
        way = plan.tips[bone] - plan.rig.places[bone]
        down = -np.eye(3)[plan.up]
        if way @ down > np.cos(HANGS) * np.linalg.norm(way) or not _room(plan, bone, way):
            continue
        turns[bone] = _first_clear(plan, bone, way, radii)
        rig = _turned(rig, bone, turns[bone])
    return rig, turns


def _room(plan: Plan, bone: int, way: np.ndarray) -> bool:
    """Return whether the hand does not reach the floor: a gorilla's arms stay as they are."""
    lowest = plan.rig.places[bone, plan.up] - float(np.linalg.norm(way))
    return lowest > plan.floor + 0.1 * plan.height


def _first_clear(plan: Plan, bone: int, way: np.ndarray, radii: list[float]) -> np.ndarray:
    """Rotation [3, 3] to the steepest angle at which the arm is clear of trunk and legs."""
    others = [b for b in range(len(radii)) if b == 0 or plan.carries(b) or plan.on_legs[b]]
    outward = np.sign(plan.rig.places[bone, plan.side] - plan.rig.places[0, plan.side])
    own = _subtree(plan.rig, bone)
    turn = np.eye(3)
    for tilt in TILTS:
        goal = np.zeros(3)
        goal[plan.up], goal[plan.side] = -np.cos(tilt), outward * np.sin(tilt)
        turn = _shortest(way / np.linalg.norm(way), goal)
        tried = Plan(plan.up, _turned(plan.rig, bone, turn))
        if all(_apart(tried, b, other, radii) for b in own for other in others):
            break
    return turn


def _apart(plan: Plan, bone: int, other: int, radii: list[float]) -> bool:
    one, two = points_along(plan, bone), points_along(plan, other)
    if not (len(one) and len(two)):
        return True
    away = float(np.linalg.norm(one[:, None] - two, axis=2).min())
    return away > radii[bone] + radii[other]


def _shortest(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Rotation [3, 3] by the smallest angle from one unit vector to another."""
    axis = np.cross(one, other)
    size = float(np.linalg.norm(axis))
    angle = float(np.arctan2(size, one @ other))
    turned: np.ndarray = Rotation.from_rotvec(axis / max(size, 1e-12) * angle).as_matrix()
    return turned


def _subtree(rig: Rig, bone: int) -> list[int]:
    below = {bone}
    for other, parent in enumerate(rig.parents):
        if parent in below:
            below.add(other)
    return sorted(below)


def _turned(rig: Rig, bone: int, turn: np.ndarray) -> Rig:
    """Return the skeleton with a bone and all below it rotated about the bone's beginning."""
    at, moved = rig.places[bone], set(_subtree(rig, bone))

    def each(spots: np.ndarray) -> np.ndarray:
        placed: np.ndarray = at + (spots - at) @ turn.T
        return placed

    def group(spots: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        return tuple(each(own) if b in moved and len(own) else own for b, own in enumerate(spots))

    places = rig.places.copy()
    places[sorted(moved)] = each(places[sorted(moved)])
    return dataclasses.replace(rig, places=places, ends=group(rig.ends), skins=group(rig.skins))
