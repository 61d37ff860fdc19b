"""Bodies, joints and shapes of a creature between the compiled model and its folder.

All quantities are in SI units.
"""

import contextlib
import dataclasses

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from mjxgait.creature.geometry import rotation

GEOM = mujoco.mjtGeom
FREE, BALL, SLIDE, HINGE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("FREE", "BALL", "SLIDE", "HINGE")
)
MOST_POINTS = 48
"""Most points of a mesh's hull."""
RINGS = 16


@dataclasses.dataclass(eq=False)
class Joint:
    """A hinge.

    pos, axis: [3] in the body's frame. low, high: rad, infinite where unlimited. ref: rad, the
    angle of the body as placed. effort: N·m, nan where the file states none. id: in the compiled
    model; a hinge made of a ball joint has the ball's. stopped: whether its limits act as in the
    file.
    """

    name: str
    id: int
    pos: np.ndarray
    axis: np.ndarray
    low: float
    high: float
    ref: float
    armature: float
    effort: float
    stopped: bool = False


@dataclasses.dataclass(eq=False)
class Shape:
    """A geom.

    kind: MuJoCo's geom type. size: [3] m. pos [3], quat [4]: in the body's frame. rgba: [4].
    points: [n, 3] m in the body's frame, and radius m: the shape is the hull of balls of this
    radius about the points. solid: whether it touches things in the file. seen: whether it is
    drawn. name: for the written file.
    """

    kind: int
    size: np.ndarray
    pos: np.ndarray
    quat: np.ndarray
    rgba: np.ndarray
    points: np.ndarray
    radius: float
    solid: bool
    seen: bool
    name: str = ""


@dataclasses.dataclass(eq=False)
class Body:
    """A body.

    pos [3], quat [4]: in the parent's frame, with all joints at `ref`. mass: kg. ipos, iquat,
    inertia: of the principal frame, kg·m². id: in the compiled model. parent: place in the list, -1
    for the root.
    """

    name: str
    id: int
    parent: int
    pos: np.ndarray
    quat: np.ndarray
    mass: float
    ipos: np.ndarray
    iquat: np.ndarray
    inertia: np.ndarray
    joints: list[Joint]
    shapes: list[Shape]


def read_shapes(model: mujoco.MjModel, body: int) -> list[Shape]:
    """Read the geoms of a body, without planes and height fields."""
    shapes = []
    for g in range(model.ngeom):
        kind = int(model.geom_type[g])
        if model.geom_bodyid[g] != body or kind in (
            GEOM.mjGEOM_PLANE,
            GEOM.mjGEOM_HFIELD,
            GEOM.mjGEOM_SDF,
        ):
            continue
        local, radius = _points(model, g)
        pos, quat = model.geom_pos[g].copy(), model.geom_quat[g].copy()
        material = int(model.geom_matid[g])
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[g]
        solid = bool(model.geom_contype[g] or model.geom_conaffinity[g])
        seen = bool(model.geom_group[g] < 3 and rgba[3] > 0)
        points = pos + local @ rotation(quat).T
        shapes.append(
            Shape(
                kind,
                model.geom_size[g].copy(),
                pos,
                quat,
                rgba.astype(float).copy(),
                points,
                radius,
                solid,
                seen,
            )
        )
    return shapes


def _points(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, float]:
    """Points [n, 3] and radius, in the geom's own frame."""
    a, b, c = (float(s) for s in model.geom_size[geom])
    turn = np.linspace(0, 2 * np.pi, RINGS, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1)
    match int(model.geom_type[geom]):
        case GEOM.mjGEOM_SPHERE:
            return np.zeros((1, 3)), a
        case GEOM.mjGEOM_CAPSULE:
            return np.array([[0, 0, -b], [0, 0, b]]), a
        case GEOM.mjGEOM_CYLINDER:
            return np.concatenate([ring * a + [0, 0, -b], ring * a + [0, 0, b]]), 0.0
        case GEOM.mjGEOM_ELLIPSOID:
            tilts = np.linspace(-np.pi / 2, np.pi / 2, 9)
            ball = np.concatenate([ring * np.cos(t) + [0, 0, np.sin(t)] for t in tilts])
            return ball * [a, b, c], 0.0
        case GEOM.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            start = int(model.mesh_vertadr[mesh])
            return hull_points(
                model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])].astype(float)
            ), 0.0
        case _:
            corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            return corners * [a, b, c], 0.0


def hull_points(points: np.ndarray) -> np.ndarray:
    """Return at most `MOST_POINTS` corners of the convex hull of points [n, 3]."""
    with contextlib.suppress(QhullError, ValueError):  # flat: all points stay
        points = points[ConvexHull(points).vertices]
    if len(points) <= MOST_POINTS:
        return points
    # Spread out: each next point is the farthest from the chosen ones.
    chosen = [int(np.argmin(points[:, 2]))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    for _ in range(MOST_POINTS - 1):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return points[chosen]
