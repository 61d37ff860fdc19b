"""Capsules for moving parts that the file gives no shape.

Without a shape a part is in no picture, has no sole, and stands in nothing.
"""

import itertools
import math

import mujoco
import numpy as np

from mjxgait.creature.geometry import rotation
from mjxgait.errors import listed
from mjxgait.importer.notes import Notes
from mjxgait.importer.shapes import HIDDEN, Bar, bar, mark

LEAST_SHARE = 0.01
"""Share of the body's mass below which a part may have no shape."""
SHORT = 1e-3
"""m, largest distance of joints at one place."""
DENSITY = 1000.0
"""kg/m³ of a capsule."""


def add_bones(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Add a capsule, which is only drawn, along the bone of each moving part without any shape.

    A bone leads from joint to joint, or through the centre of mass where no joint follows. A part
    with all joints at one place, such as the cross of a hip, has none.
    """
    bodies = spec.bodies[1:]
    least = LEAST_SHARE * sum(body.mass for body in bodies)
    moving = [body for body in bodies if body.joints and _mass(body) >= least]
    bare = [body for body in moving if not any(map(_has_shape, _rigid(body)))]
    bones = {body.name: bone.added(body) for body in bare if (bone := _bone(body))}
    for geom in bones.values():
        mark(geom, solid=False, seen=True)
    if bones:
        notes.change(
            f"capsules for {listed(list(bones))}",
            "the file has no shape for them that can be read; each lies along its bone and has its "
            "part's weight",
        )


def _rigid(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """Return a moving body and the bodies fixed to it."""
    return [part for part, _ in _placed(body, np.eye(4))]


def _placed(body: mujoco.MjsBody, place: np.ndarray) -> list[tuple[mujoco.MjsBody, np.ndarray]]:
    """Return the bodies of `_rigid`, each with its transform [4, 4]; place: that of `body`."""
    below = (_placed(c, place @ _transform(c)) for c in body.bodies if not c.joints)
    return [(body, place), *itertools.chain.from_iterable(below)]


def _transform(body: mujoco.MjsBody) -> np.ndarray:
    """Return the transform [4, 4] from a body's frame to its parent's."""
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation(body.quat), body.pos
    return transform


def _moved(transform: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return a point [3] of a body's frame in the frame that its transform leads to."""
    moved: np.ndarray = transform[:3, :3] @ point + transform[:3, 3]
    return moved


def _mass(body: mujoco.MjsBody) -> float:
    return float(sum(part.mass for part in _rigid(body)))


def _has_shape(body: mujoco.MjsBody) -> bool:
    return any(geom.conaffinity or geom.group < HIDDEN for geom in body.geoms)


def _bone(body: mujoco.MjsBody) -> Bar | None:
    """Return the capsule of a part; of the trunk between the joints that are farthest apart.

    A trunk with one joint has it through its centre of mass.
    """
    parts = _placed(body, np.eye(4))
    ends = [
        _moved(place @ _transform(child), child.joints[0].pos)
        for part, place in parts
        for child in part.bodies
        if child.joints
    ]
    middle = sum(part.mass * _moved(place, part.ipos) for part, place in parts if part.mass)
    middle /= _mass(body)
    is_trunk = body.joints[0].type == mujoco.mjtJoint.mjJNT_FREE
    points = (ends if is_trunk else [body.joints[0].pos, *ends]) or [middle]
    if len(points) == 1:
        points = [points[0], 2 * middle - points[0]]
    between = itertools.combinations(points, 2)
    pairs = list(between) if is_trunk else [(points[0], end) for end in points[1:]]
    a, b = max(pairs, key=lambda two: float(np.linalg.norm(two[1] - two[0])))
    length = float(np.linalg.norm(b - a))
    if ends and length < SHORT:
        return None
    return bar(0, a, b, _radius(_mass(body), length), seen=True)


def _radius(mass: float, length: float) -> float:
    """Radius in m of a capsule of this mass in kg, between ends this far apart in m."""
    volume = mass / DENSITY
    roots = np.roots([4 / 3 * math.pi, math.pi * length, 0.0, -volume])
    return float(max(root.real for root in roots if abs(root.imag) < 1e-9))
