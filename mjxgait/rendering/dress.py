"""Look of bodies that grew: a colour for each node of the graph, and two eyes on the root.

Colours and eyes are in no simulation. Letters: `T` frames.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.controllers.sims_brain.reference_body import Part

PALETTE = np.array(
    [
        [0.91, 0.45, 0.36],
        [0.97, 0.75, 0.33],
        [0.30, 0.68, 0.60],
        [0.62, 0.50, 0.80],
        [0.68, 0.78, 0.38],
        [0.92, 0.60, 0.72],
        [0.93, 0.88, 0.76],
        [0.36, 0.52, 0.80],
    ]
)
"""sRGB of the nodes by number; a ninth node has the first colour again."""
EYE_WHITE, PUPIL = (0.98, 0.98, 0.96), (0.10, 0.10, 0.13)
EYE, WIDEST_EYE = 0.34, 0.46
"""Radius of an eye over the face's mean half size, and over its half width at most."""
LOOKS_OUT, PUPIL_SIZE = 0.62, 0.58
"""Place of the pupil ahead of the eye's middle, and its radius, in radii of the eye."""
DARKER = 0.5
"""Brightness of an opponent."""
CUBE_COLOUR = (0.98, 0.96, 0.88, 1.0)
LOOKS_UP = 0.3
"""Worth of a face that looks up, over that of one that looks along the way."""
DECORATION = {"contype": 0, "conaffinity": 0, "mass": 0.0, "group": 1}


def colour_of(node: int) -> np.ndarray:
    """Return the colour [4] of a node's parts: red, green, blue and opacity, 0 to 1."""
    return np.append(PALETTE[node % len(PALETTE)], 1.0)


def dress(
    spec: mujoco.MjSpec,
    parts: Sequence[Part],
    eyes: tuple[np.ndarray, np.ndarray],
    prefix: str = "",
) -> None:
    """Colour the blocks of a grown body's specification, and add eyes to its root.

    An opponent is darker. eyes: normal of their face and their upward axis, unit vectors [3] along
    the root's axes. prefix: of the names of bodies and blocks.
    """
    tint = np.array([*[DARKER] * 3, 1.0]) if prefix else np.ones(4)
    for number, part in enumerate(parts):
        spec.geom(f"{prefix}block{number}").rgba = tint * colour_of(part.node)
    root = spec.body(f"{prefix}part0")
    out, up = eyes
    side, half = np.abs(np.cross(up, out)), parts[0].half
    wide, high = half @ side, half @ np.abs(up)
    radius = min(EYE * float(np.sqrt(wide * high)), WIDEST_EYE * float(wide))
    above = max(high - 1.2 * radius, 0.0)
    for sign in (1.0, -1.0):
        middle = (half @ np.abs(out)) * out + above * up + sign * 0.5 * wide * side
        _add_ball(root, middle, radius, EYE_WHITE)
        _add_ball(root, middle + LOOKS_OUT * radius * out, PUPIL_SIZE * radius, PUPIL)


def _add_ball(
    body: mujoco.MjsBody, place: np.ndarray, radius: float, colour: tuple[float, float, float]
) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        pos=place,
        size=[radius, 0, 0],
        rgba=[*colour, 1.0],
        **DECORATION,
    )


def face_of_eyes(
    parts: Sequence[Part], rot: np.ndarray, way: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal of the eyes' face and their upward axis, unit vectors [3] of the root.

    The face is one without a joint that looks along the way most of the time.

    Args:
      rot: [T, 3, 3] of the root. way: [3] direction in the world, unit; zero where it has none.
    """
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    ahead = (rot.transpose(0, 2, 1) @ way).mean(0) if way.any() else axes[0]
    up = (rot.transpose(0, 2, 1) @ [0.0, 0.0, 1.0]).mean(0)
    taken = [_face(parts[0].half, part.place) for part in parts if part.parent == 0]
    worth = axes @ (ahead + LOOKS_UP * up)
    worth[taken] -= 4.0
    out = axes[int(worth.argmax())]
    upward = np.where(np.abs(axes @ out) > 0.5, -np.inf, axes @ up)
    return out, axes[int(upward.argmax())]


def _face(half: np.ndarray, place: np.ndarray) -> int:
    """Number of the face with a joint at place [3] m: 0 to 2 along an axis, 3 to 5 against it."""
    axis = int(np.argmax(np.abs(place) / half))
    return axis + 3 * bool(place[axis] < 0)
