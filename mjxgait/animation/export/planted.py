"""Feet of a character on the floor, by the vertices of its skin.

The simulated feet are capsules. The skin of a paw is thicker or thinner than they are, and not by
the same on each foot. So the body moves up or down by one number, and each leg bends or straightens
by the rest, until the lowest vertex of each foot is as high as the simulated foot. Letters: `F` key
frames, `N` nodes of the file, `K` bones of a leg.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.animation.export.character import Character
from mjxgait.animation.export.fit import Placement, lows_of_feet
from mjxgait.animation.export.loop import WalkLoop
from mjxgait.animation.export.posed import Goal, posed
from mjxgait.animation.export.skin import Sole, below, soles_of
from mjxgait.creature import Creature

NEAR = 0.1
"""Hip heights that the resting feet may be off the origin for the floor to be there."""
DOWN = 0.01
"""Hip heights above the floor up to which a simulated foot stands on it."""
CLOSE = 0.0045
"""Hip heights by which the skin may be off the simulated foot, and that into the floor."""
LOWERED, SPARE = 4, 0.1
"""Tries, each with a lower body, until straight legs reach the floor; and what is left of CLOSE."""
ROUNDS, DAMPED, MAX_TURN = 8, 0.05, 0.2
"""Steps in which a leg finds its angles; damping over the leg's length; rad per step."""

Bones = Mapping[str, int]
"""Node of the file by part of the creature."""
GoalsOf = Callable[[WalkLoop, Placement], dict[int, Goal]]


@dataclasses.dataclass(frozen=True, eq=False)
class Leg:
    """A foot with skin, and the bones that raise it.

    foot: its number. sole: its vertices. node: that of the foot. turning: bones that turn, from the
    lowest up. follows: by each bone that turns, the nodes with goals that turn with it.
    """

    foot: int
    sole: Sole
    node: int
    turning: tuple[int, ...]
    follows: Mapping[int, Sequence[int]]

    def arms(self, world: np.ndarray, low: np.ndarray) -> np.ndarray:
        """From each bone that turns to the point that it moves, [F, K, 3].

        low: [F, 3] lowest vertex of a foot. A foot that keeps its direction moves as its own bone.
        """
        end = low if self.node in self.turning else world[:, self.node, :3, 3]
        found: np.ndarray = end[:, None] - world[..., :3, 3][:, list(self.turning)]
        return found


def planted(
    loops: Mapping[str, WalkLoop],
    character: Character,
    bones: Bones,
    fit: Placement,
    goals_of: GoalsOf,
) -> tuple[Placement, dict[str, dict[int, Goal]]]:
    """The fit with the body at its height, and the goals by loop with the feet on the floor.

    A character without skin at its feet keeps the fit.

    goals_of: the goals of the bones, as the simulated body moves.
    """
    creature = next(iter(loops.values())).walk.creature
    legs = _legs(creature, character, bones)
    if not legs:
        return fit, {name: goals_of(loop, fit) for name, loop in loops.items()}
    floor = _floor(creature, character, bones, legs, fit)
    heights = {name: fit.factor * lows_of_feet(loop) for name, loop in loops.items()}
    gaps = []
    for name, loop in loops.items():
        _, world = posed(character, goals_of(loop, fit))
        skin = [leg.sole.lows(world, fit.up) for leg in legs]
        gaps.append(np.stack(skin, 1) - heights[name][:, [leg.foot for leg in legs]])
    unit = fit.factor * creature.frame.hip_height
    height = np.concatenate(list(heights.values()))[:, [leg.foot for leg in legs]]
    fit = fit.raised(floor - _middle(np.concatenate(gaps), height < DOWN * unit))
    for _ in range(LOWERED):
        found, floats = {}, 0.0
        for name, loop in loops.items():
            targets = floor + np.maximum(heights[name], -CLOSE * unit)
            goals = _on_floor(character, legs, goals_of(loop, fit), targets, fit.up, CLOSE * unit)
            missed = _missed(legs, posed(character, goals)[1], targets, fit.up)
            down = heights[name][:, [leg.foot for leg in legs]] < DOWN * unit
            floats = max(floats, float(missed.max(initial=0.0, where=down)))
            found[name] = goals
        if floats < (1 + SPARE) * CLOSE * unit:
            break
        fit = fit.raised(CLOSE * unit - floats)
    return fit, found


def _missed(
    legs: Sequence[Leg], world: np.ndarray, targets: np.ndarray, up: np.ndarray
) -> np.ndarray:
    """Heights [F, legs] of the lowest vertices above their targets [F, feet]."""
    return np.stack([leg.sole.lows(world, up) - targets[:, leg.foot] for leg in legs], 1)


def _middle(gaps: np.ndarray, down: np.ndarray) -> float:
    """Middle of the feet's gaps, each the median over the frames [F, feet] in which it is down."""
    medians = [np.median(own[on]) for own, on in zip(gaps.T, down.T, strict=True) if on.any()]
    medians = medians or [np.median(own) for own in gaps.T]
    return float(max(medians) + min(medians)) / 2


def _legs(creature: Creature, character: Character, bones: Bones) -> list[Leg]:
    """The legs with skin at their feet."""
    model, feet = creature.model, creature.feet
    chains, tops, nodes = [], [], []
    moves = {node for part, node in bones.items() if model.body(part).jntnum[0]}
    moves.discard(bones[model.body(creature.trunk).name])
    for foot in range(len(feet.names)):
        names = [model.body(model.geom_bodyid[geom]).name for geom in feet.geoms_of(foot)]
        own = {bones[name] for name in names if name in bones}
        tops.append(next((n for n in character.order if n in own), -1))
        nodes.append(below(character, own))
        chains.append([n for n in character.above(tops[-1]) if n in moves] if own else [])
    found = []
    for foot, sole in enumerate(soles_of(character, nodes)):
        if sole is None:
            continue
        others = {n for other, chain in enumerate(chains) if other != foot for n in chain}
        turning = [n for n in chains[foot] if n not in others]
        if len(turning) < 2 and tops[foot] in moves:
            turning = [tops[foot], *turning]
        follows = _following(character, set(bones.values()), turning, tops[foot])
        found.append(Leg(foot, sole, tops[foot], tuple(turning), follows))
    return found


def _following(
    character: Character, goals: set[int], turning: Sequence[int], foot: int
) -> dict[int, list[int]]:
    """The nodes with goals that turn with each bone: all below it but a foot with its direction."""
    still = set() if foot in turning else below(character, {foot})
    return {node: [*(below(character, {node}) & goals - still)] for node in turning}


def _floor(
    creature: Creature, character: Character, bones: Bones, legs: Sequence[Leg], fit: Placement
) -> float:
    """Height of the floor in the scene.

    It is at the origin of the scene, or of the topmost node above the bones, if the resting feet
    are near it; else where they are lowest.
    """
    rest = min(float(leg.sole.lows(character.world[None], fit.up)[0]) for leg in legs)
    above = character.above(bones[creature.model.body(creature.trunk).name])
    origins = [0.0, *(float(character.world[node, :3, 3] @ fit.up) for node in above[-1:])]
    nearest = min(origins, key=lambda height: abs(height - rest))
    near = abs(nearest - rest) < NEAR * fit.factor * creature.frame.hip_height
    return nearest if near else rest


def _on_floor(
    character: Character,
    legs: Sequence[Leg],
    goals: Mapping[int, Goal],
    targets: np.ndarray,
    up: np.ndarray,
    close: float,
) -> dict[int, Goal]:
    """Goals by which the lowest vertex of each foot comes to its height.

    targets: [F, feet] heights in the scene. close: distance from them that is left.
    """
    goals, start = dict(goals), posed(character, goals)[1]
    for _ in range(ROUNDS):
        _, world = posed(character, goals)
        for leg in legs:
            which = leg.sole.lowest(world, up)
            low = leg.sole.places(world, which)
            miss = targets[:, leg.foot] - low @ up
            miss -= np.clip(miss, -close, close)
            way = leg.sole.places(start, which) - low
            way += (miss - way @ up)[:, None] * up  # to the side it stays where it was
            if leg.turning and miss.any():
                _bend(goals, leg, leg.arms(world, low), way)
    return goals


def _bend(goals: dict[int, Goal], leg: Leg, arms: np.ndarray, way: np.ndarray) -> None:
    """Turn a leg's bones so that its foot moves by `way` [F, 3], by damped least squares.

    arms: see `Leg.arms`.
    """
    turn = np.stack([np.cross(axis, arms) for axis in np.eye(3)], 2)
    jacobian = turn.reshape(len(way), -1, 3)  # from each angle to a motion
    damped = DAMPED**2 * np.square(arms).sum(2).max(1)
    square = jacobian.transpose(0, 2, 1) @ jacobian + damped[:, None, None] * np.eye(3)
    angles = (jacobian @ np.linalg.solve(square, way[..., None])).reshape(arms.shape)
    angles /= np.maximum(np.abs(angles).max((1, 2), keepdims=True) / MAX_TURN, 1.0)
    for i, node in enumerate(leg.turning):
        by = Rotation.from_rotvec(angles[:, i]).as_matrix()
        for each in leg.follows[node]:
            moved = goals[each].world.copy()
            moved[:, :3, :3] = by @ moved[:, :3, :3]
            goals[each] = dataclasses.replace(goals[each], world=moved)
