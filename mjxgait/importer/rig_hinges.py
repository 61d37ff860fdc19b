"""Hinges between the bones of a skeleton.

A limb swings and spreads where it begins, and bends in one direction below; a spine bends in one
place. Axes are the file's; angles are deg from rest.
"""

import dataclasses
import itertools

import numpy as np

from mjxgait.importer.notes import Confidence
from mjxgait.importer.rig import SHORT, Plan, toes

BENT = np.radians(8.0)
SWING, SPREAD, SPINE, ANKLE, LOOSE = 60.0, 30.0, 25.0, 45.0, 45.0
FOLD, STRETCH = 75.0, 3.0
"""deg that a knee folds from its rest pose; deg that it stays away from straight."""
KNEE = (5.0, 110.0)
"""deg that a knee which rests straight bends the wrong way, and the right way."""


@dataclasses.dataclass(frozen=True, eq=False)
class Hinge:
    """Hinge of a bone. name: pitch, roll or yaw. axis: [3]. low, high: deg."""

    name: str
    axis: np.ndarray
    low: float
    high: float
    confidence: Confidence
    reason: str


def hinges_of(plan: Plan) -> list[list[Hinge]]:
    """Hinges of each bone; none for the root."""
    found: list[list[Hinge]] = [[] for _ in plan.rig.names]
    for bone in range(1, len(found)):
        if plan.is_limb(bone):
            _limb(plan, bone, found)
        elif plan.in_middle(bone) and not plan.sides_below[bone] and plan.moves(bone):
            found[bone] = _spine(plan, "it may nod and turn")
    for bone in plan.rig.children(0):
        chain = _spine_below(plan, bone)
        if chain:
            found[chain[(len(chain) - 1) // 2]] = _spine(plan, "the trunk bends in one place")
    return found


def _spine_below(plan: Plan, bone: int) -> list[int]:
    """Bones of the trunk from one on down that are long enough to bend."""
    chain: list[int] = []
    following = [bone]
    while following and plan.carries(following[0]):
        chain.append(following[0])
        following = [b for b in plan.rig.children(following[0]) if plan.carries(b)]
    return [b for b in chain if plan.moves(b)]


def _limb(plan: Plan, first: int, found: list[list[Hinge]]) -> None:
    """Fill in the hinges of a limb, its side branches and toes rigid."""
    chain = plan.limb(first)
    ends = (i for i, bone in enumerate(chain) if bone in plan.feet or plan.has_toes(bone))
    below = next(ends, len(chain))
    *upper, last = chain[: below + 1]
    chain = [*filter(plan.moves, upper), *[last] * (plan.reach(last) > SHORT * plan.height)]
    if not chain:
        return
    ways = [plan.way(bone) for bone in chain]
    if chain[-1] == last and last not in plan.feet:
        ways[-1] = plan.tips[last] - plan.rig.places[last]
    along = np.abs(plan.tips[first] - plan.rig.places[first])
    vertical = int(along.argmax()) == plan.up
    found[chain[0]] = _hip(plan, int(along.argmax()))
    for (one, other), bone in zip(itertools.pairwise(ways), chain[1:], strict=True):
        is_last = bone == chain[-1]
        found[bone] = [_knee(plan, one, other, is_last, vertical, toes(plan, chain[-1]))]


def _hip(plan: Plan, along: int) -> list[Hinge]:
    """Hinges about the two axes across the limb; the wider one is the stride."""
    swings = plan.up if along == plan.side else plan.side
    other = next(axis for axis in (plan.ahead, plan.up, plan.side) if axis not in (along, swings))
    reason = "a limb swings and spreads where it begins"
    return [
        Hinge(_name(plan, swings), np.eye(3)[swings], -SWING, SWING, "medium", reason),
        Hinge(_name(plan, other), np.eye(3)[other], -SPREAD, SPREAD, "medium", reason),
    ]


def _knee(
    plan: Plan, one: np.ndarray, other: np.ndarray, last: bool, vertical: bool, forward: float
) -> Hinge:
    """Hinge between two bones of a limb with directions [3], across the plane that they span."""
    across = np.cross(one, other)
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    if float(np.linalg.norm(across)) > np.sin(BENT) * size:
        number = int(np.abs(across).argmax())
        axis = np.eye(3)[number]
        bend = float(np.degrees(np.arctan2(axis @ across, one @ other)))
        straight = -bend + np.sign(bend) * STRETCH
        fold = np.sign(bend) * (ANKLE if last else FOLD)
        low, high = sorted((float(np.clip(straight, -FOLD, FOLD)), float(fold)))
        reason = "across the plane in which it rests bent, no further than straight"
        return Hinge(_name(plan, number), axis, low, high, "medium", reason)
    number = plan.side if vertical else plan.ahead
    axis = np.eye(3)[number]
    if last or not vertical or not forward:
        return Hinge(_name(plan, number), axis, -LOOSE, LOOSE, "low", "it rests straight")
    back = -np.sign(float(np.cross(axis, other)[plan.ahead]) * forward)
    low, high = sorted((-back * KNEE[0], back * KNEE[1]))
    reason = "it rests straight; taken for a knee, which folds away from the toes"
    return Hinge(_name(plan, number), axis, low, high, "low", reason)


def _spine(plan: Plan, reason: str) -> list[Hinge]:
    return [
        Hinge(_name(plan, axis), np.eye(3)[axis], -SPINE, SPINE, "low", reason)
        for axis in (plan.side, plan.up)
    ]


def _name(plan: Plan, axis: int) -> str:
    return {plan.side: "pitch", plan.ahead: "roll", plan.up: "yaw"}[axis]
