"""The creature's surface in its rest pose, one piece per colour, each point bound to one joint.

glTF's axes: Y up, forward +Z. Letters: `V` points, `F` triangles.
"""

import dataclasses

import mujoco
import numpy as np

from mjxgait.animation.export.skeleton import Skeleton
from mjxgait.animation.export.surface import geom_surface
from mjxgait.rendering.painter import geom_colours, seen_geoms


@dataclasses.dataclass(frozen=True, eq=False)
class Piece:
    """A surface of one colour.

    name: of its material. colour: sRGB [4]. points: [V, 3] m. normals: [V, 3]. faces: [F, 3]
    counterclockwise from outside. joints: [V] places in the skeleton.
    """

    name: str
    colour: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    joints: np.ndarray


def pieces_of(
    model: mujoco.MjModel, skeleton: Skeleton, axes: np.ndarray, rest: np.ndarray
) -> list[Piece]:
    """The visible surface of the skeleton's bodies in a pose [nq]."""
    data = mujoco.MjData(model)
    data.qpos[:] = rest
    mujoco.mj_kinematics(model, data)
    colours = geom_colours(model)
    geoms = [int(g) for g in seen_geoms(model) if int(model.geom_bodyid[g]) in skeleton.bodies]
    return [
        _piece(model, data, skeleton, axes, [g for g in geoms if tuple(colours[g]) == colour])
        for colour in dict.fromkeys(tuple(colours[g]) for g in geoms)
    ]


def linear(colour: np.ndarray) -> np.ndarray:
    """Convert sRGB [3] to the linear colours of glTF and USD."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def _piece(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    skeleton: Skeleton,
    axes: np.ndarray,
    geoms: list[int],
) -> Piece:
    """The piece made of geoms of one colour."""
    points, normals, faces, joints, count = [], [], [], [], 0
    for g in geoms:
        own, facing, triangles = geom_surface(model, g)
        turn = axes @ data.geom_xmat[g].reshape(3, 3)
        points.append(own @ turn.T + axes @ data.geom_xpos[g])
        normals.append(facing @ turn.T)
        faces.append(triangles + count)
        joints.append(np.full(len(own), skeleton.bodies.index(int(model.geom_bodyid[g]))))
        count += len(own)
    arrays = (np.concatenate(each) for each in (points, normals, faces, joints))
    return Piece(_name(model, geoms[0]), geom_colours(model)[geoms[0]], *arrays)


def _name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom's material, else of its body."""
    material, body = int(model.geom_matid[geom]), int(model.geom_bodyid[geom])
    called = model.mat(material).name if material >= 0 else model.body(body).name
    return str(called) or f"body_{body}"
