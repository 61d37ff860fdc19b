"""Thickness of a skeleton's parts, which are capsules along its bones. Letters: `B` bones."""

import itertools
from collections.abc import Sequence

import numpy as np

from mjxgait.importer.rig import Plan
from mjxgait.importer.rig_hinges import Hinge

THICK, THIN, TRUNK, SLIM = 0.12, 0.008, 0.7, 0.2
"""Radius of a limb's bone over its length; least radius over the creature's height; trunk radius
over half its width between the limbs; radius of a neck or tail over its bones' length, at most half
a trunk's.
"""
SKINNED = 8
"""Least number of vertices that determine the thickness of a bone's part."""
SLIMMEST, POINTS = 0.5, 9
"""Share of its radius to which a limb is made slimmer; points along a bone that stand for it."""
FOLDED = 0.85
"""Share of the way between two parts with one between them, at rest, that their radii may fill: a
shin comes nearer to the hip when the knee bends.
"""


def radii_of(plan: Plan) -> list[float]:
    """Radius in m of each bone's capsules, alike on both sides: skins are seldom quite symmetric.

    A body that is heavier on one side walks in a circle.
    """
    own = [_radius(plan, bone) for bone in range(len(plan.rig.names))]
    return [(radius + own[image]) / 2 for radius, image in zip(own, plan.images, strict=True)]


def _radius(plan: Plan, bone: int) -> float:
    """Radius in m of a bone's capsules, from its skin where there is one."""
    rig = plan.rig
    segments = plan.segments(bone)
    length = max((float(np.linalg.norm(b - a)) for a, b in segments), default=0.0)
    if len(rig.skins[bone]) >= SKINNED and segments:
        away = np.min([_distances(rig.skins[bone], a, b) for a, b in segments], axis=0)
        form = narrow_radius if plan.in_middle(bone) else round_radius
        radius = min(float(np.median(away)), form(rig.skins[bone], *segments[0]))
        return float(np.clip(radius, THIN * plan.height, 0.3 * plan.height))
    least = THIN * plan.height
    sideways = int(np.abs(plan.way(bone)).argmax()) == plan.side  # such as a collar bone
    if plan.carries(bone) and not sideways:
        return max(TRUNK * plan.half_width, least)
    share, most = (SLIM, 0.5) if plan.in_middle(bone) else (THICK, 1.0)
    return max(min(share * length, most * TRUNK * plan.half_width or np.inf), least)


def round_radius(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Radius in m of a round bar with the area of the cross-section of points [V, 3].

    That of a wing or a fin, which is broad and flat, is far smaller than its points' distance.
    """
    return float(_half_widths(points, end - start).prod() ** 0.5)


def narrow_radius(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Radius in m of a round bar that is as wide as the cross-section where it is narrowest.

    A chest is higher than wide; a rounder one would have the arms in it.
    """
    return float(_half_widths(points, end - start).min())


def _half_widths(points: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Half axes [2] in m of an ellipse; its outline has the moments of points [V, 3]."""
    across = np.linalg.svd(along[None])[2][1:]
    moments = np.linalg.eigvalsh(np.cov(across @ points.T, bias=True))
    widths: np.ndarray = np.sqrt(2.0 * np.maximum(moments, 0.0))
    return widths


def _distances(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distances [V] in m of points [V, 3] from the segment between two ends."""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.linalg.norm(points - a - share[:, None] * along, axis=1)


def slimmer(plan: Plan, hinges: Sequence[Sequence[Hinge]], radii: Sequence[float]) -> list[float]:
    """Radii of legs that at rest are not within parts other than their neighbours.

    The flesh of a fat thigh folds where a capsule cannot.
    """
    part, above = _parts(plan, hinges)
    shapes = [points_along(plan, bone) for bone in range(len(radii))]
    slim = list(radii)
    legs = [bone for bone, inside in enumerate(plan.on_legs) if inside]
    for bone, other in itertools.product(legs, range(len(radii))):
        one, two = part[bone], part[other]
        near = one == two or above[one] == two or above[two] == one
        if near:
            continue
        gap = apart(shapes[bone], shapes[other])
        if one == above[above[two]] or two == above[above[one]]:
            gap *= FOLDED
        both = gap / (radii[bone] + radii[other])  # between two legs, each gives way
        share = both if other in legs else (gap - radii[other]) / radii[bone]
        slim[bone] = min(slim[bone], radii[bone] * max(share, SLIMMEST))
    return slim


def _parts(plan: Plan, hinges: Sequence[Sequence[Hinge]]) -> tuple[list[int], dict[int, int]]:
    """First bone of each bone's part, a group that moves as one; and the part above each part.

    Heads and tails move with the trunk, because they take no part in walking.
    """
    first: list[int] = []
    above = {0: 0}
    for bone, parent in enumerate(plan.rig.parents):
        moves = hinges[bone] and (plan.on_limbs[bone] or plan.carries(bone))
        first.append(bone if parent < 0 or moves else first[parent])
        if first[bone] == bone:
            above[bone] = first[parent] if parent >= 0 else bone
    return first, above


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Least distance in m between two sets of points [n, 3], infinite if one is empty."""
    return float(np.linalg.norm(one[:, None] - other, axis=2).min(initial=np.inf))


def points_along(plan: Plan, bone: int) -> np.ndarray:
    """Points [n, 3] along a bone."""
    along = np.linspace(0.0, 1.0, POINTS)[:, None]
    lines = [start + along * (end - start) for start, end in plan.segments(bone)]
    return np.concatenate(lines) if lines else np.zeros((0, 3))
