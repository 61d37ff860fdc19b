"""Arms of an upright figure: a skeleton rests with arms spread, and the body lets them hang."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import Rig
from mjxgait.importer.rig import Plan
from mjxgait.importer.rig_radii import apart, points_along

HANGS = np.radians(30.0)
"""Angle from the vertical within which an arm hangs already."""
TILTS = np.radians([8.0, 16.0, 24.0, 32.0, 40.0])
"""Angles from the vertical, outwards, that are tried until the arm is clear of trunk and legs."""


def hanging(plan: Plan, radii: Sequence[float]) -> tuple[Plan, dict[int, Rotation]]:
    """Return the plan with hanging arms, and the rotation of each arm by its upper bone.

    radii: of the bones' capsules, m.
    """
    turns: dict[int, Rotation] = {}
    for bone, *_ in plan.arms.values():
        way = plan.tips[bone] - plan.rig.places[bone]
        down = -np.eye(3)[plan.up]
        if way @ down <= np.cos(HANGS) * np.linalg.norm(way) and _room(plan, bone, way):
            turns[bone] = _first_clear(plan, bone, way, radii)
    if not turns:
        return plan, turns
    rig = plan.rig
    for bone, turn in turns.items():
        rig = _turned(rig, bone, turn)
    return Plan(plan.up, rig), turns


def _room(plan: Plan, bone: int, way: np.ndarray) -> bool:
    """Return whether the hand does not reach the floor: a gorilla's arms stay as they are."""
    lowest = plan.rig.places[bone, plan.up] - float(np.linalg.norm(way))
    return bool(lowest > plan.floor + 0.1 * plan.height)


def _first_clear(plan: Plan, bone: int, way: np.ndarray, radii: Sequence[float]) -> Rotation:
    """Rotation to the steepest angle at which the arm is clear of trunk and legs."""
    at, own = plan.rig.places[bone], plan.rig.subtree(bone)
    others = [b for b in range(len(radii)) if plan.carries(b) or plan.on_legs[b]]
    shapes = {b: points_along(plan, b) for b in (*own, *others)}
    outward = np.sign(at[plan.side] - plan.rig.places[0, plan.side])
    turn = Rotation.identity()
    for tilt in TILTS:
        goal = np.zeros(3)
        goal[plan.up], goal[plan.side] = -np.cos(tilt), outward * np.sin(tilt)
        turn = Rotation.align_vectors(goal, way)[0]
        hung = {b: at + (shapes[b] - at) @ turn.as_matrix().T for b in own}
        if all(apart(hung[b], shapes[o]) > radii[b] + radii[o] for b in own for o in others):
            break
    return turn


def _turned(rig: Rig, bone: int, turn: Rotation) -> Rig:
    """Return the skeleton with a bone and all below it rotated about the bone's beginning."""
    at, moved = rig.places[bone], rig.subtree(bone)

    def each(spots: np.ndarray) -> np.ndarray:
        placed: np.ndarray = at + (spots - at) @ turn.as_matrix().T
        return placed

    def group(spots: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        return tuple(each(own) if b in moved and len(own) else own for b, own in enumerate(spots))

    places = rig.places.copy()
    places[moved] = each(places[moved])
    return dataclasses.replace(rig, places=places, ends=group(rig.ends), skins=group(rig.skins))
