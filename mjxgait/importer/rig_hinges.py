"""Hinges between the bones of a skeleton.

A limb swings and spreads where it begins, and bends in one direction below; a spine bends in one
place. Axes are the file's; angles are deg from rest.
"""

import dataclasses
import itertools

import numpy as np

from mjxgait.importer.notes import Confidence
from mjxgait.importer.rig import SHORT, Plan, foot_direction

MOVING, GIRDLE = 3, 0.75
"""Most bones of a leg that move; share of the next bone's distance from the middle within which a
limb's first bone belongs to the trunk.
"""
BENT, SIDEWAYS = np.radians(8.0), np.radians(25.0)
"""Angles at rest from which two bones are bent; from which those of a hanging limb may bend
sideways.
"""
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
    """Fill in the hinges of a limb; its girdle, side branches and toes are rigid."""
    chain = _bending(plan, first)
    if not chain:
        return
    tip = plan.tips[first]
    ways = [plan.way(bone) for bone in chain]
    if chain[-1] not in plan.feet:
        ways[-1] = tip - plan.rig.places[chain[-1]]
    along = np.abs(tip - plan.rig.places[chain[0]])
    vertical = int(along.argmax()) == plan.up
    found[chain[0]] = _hip(plan, int(along.argmax()))
    for (one, other), bone in zip(itertools.pairwise(ways), chain[1:], strict=True):
        is_last = bone == chain[-1]
        found[bone] = [_knee(plan, one, other, is_last, vertical, foot_direction(plan, chain[-1]))]


def _bending(plan: Plan, first: int) -> list[int]:
    """Bones of a limb that move, from its beginning down.

    A leg of more than three has more poses than a search can try: its girdle, such as a shoulder
    blade, moves with the trunk, and its lowest bones with the one above, unless it stands on two
    feet.
    """
    chain = plan.limb(first)
    ends = (i for i, bone in enumerate(chain) if bone in plan.feet or plan.has_toes(bone))
    *upper, last = chain[: next(ends, len(chain)) + 1]
    chain = [*filter(plan.moves, upper), *[last] * (plan.reach(last) > SHORT * plan.height)]
    if plan.feet:
        return [bone for bone in chain if bone in plan.arms.get(first, chain)]
    if len(chain) > MOVING and plan.apart(chain[0]) < GIRDLE * plan.apart(chain[1]):
        chain = chain[1:]
    return chain[:MOVING]


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
    """Hinge between two bones of a limb with directions [3], across the plane that they span.

    A hanging limb that is slightly bent to the side, as a horse's are, bends ahead or back.
    """
    across = np.cross(one, other)
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    if vertical and float(np.linalg.norm(across)) < np.sin(SIDEWAYS) * size:
        across = across * (np.arange(3) == plan.side)
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
