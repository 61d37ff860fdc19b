"""Triangles for MuJoCo's shapes. Letters: `V` vertices, `F` triangles."""

import mujoco
import numpy as np

from mjxgait.rendering.triangles import mesh_of

GEOM = mujoco.mjtGeom
AROUND, RINGS = 20, 10
"""Number of parts of a round shape about its axis, and from pole to pole."""
FAR = 0.98
"""Share of the greatest distance from which points count among the farthest."""

Surface = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Points [V, 3] m, unit normals [V, 3], triangles [F, 3] counterclockwise from outside."""


def geom_surface(model: mujoco.MjModel, geom: int) -> Surface:
    """The surface of a geom in its own frame."""
    size = np.asarray(model.geom_size[geom], float)
    match int(model.geom_type[geom]):
        case GEOM.mjGEOM_SPHERE:
            return _ellipsoid(np.repeat(size[:1], 3))
        case GEOM.mjGEOM_ELLIPSOID:
            return _ellipsoid(size)
        case GEOM.mjGEOM_CAPSULE:
            return _capsule(size[0], size[1])
        case GEOM.mjGEOM_CYLINDER:
            return _cylinder(size[0], size[1])
        case GEOM.mjGEOM_MESH:
            return _mesh(*mesh_of(model, geom))
        case _:
            return _box(size)


def far_end(model: mujoco.MjModel, body: int, qpos: np.ndarray) -> np.ndarray:
    """Vector [3] in m, in the world, from a body's origin to the mean of its farthest points."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    points = [np.zeros((1, 3))]
    for geom in np.flatnonzero(model.geom_bodyid == body):
        local, _, _ = geom_surface(model, int(geom))
        turned = local @ data.geom_xmat[geom].reshape(3, 3).T
        points.append(turned + data.geom_xpos[geom] - data.xpos[body])
    cloud = np.concatenate(points)
    far = np.linalg.norm(cloud, axis=1)
    middle: np.ndarray = cloud[far >= FAR * far.max()].mean(0)
    return middle


def _globe() -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors [V, 3] in rings from the south to the north pole, and triangles."""
    tilt = np.linspace(-np.pi / 2, np.pi / 2, RINGS + 1)
    around = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around), np.zeros(AROUND)], 1)
    points = (
        np.cos(tilt)[:, None, None] * circle + np.sin(tilt)[:, None, None] * [0.0, 0.0, 1.0]
    ).reshape(-1, 3)
    return points, _rings(RINGS + 1)


def _rings(count: int) -> np.ndarray:
    """Triangles between rings of `AROUND` vertices.

    The caller removes those without area at the poles.
    """
    ring, step = np.meshgrid(np.arange(count - 1), np.arange(AROUND), indexing="ij")
    a, b = ring * AROUND + step, ring * AROUND + (step + 1) % AROUND
    c, d = a + AROUND, b + AROUND
    return np.concatenate(
        [np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)]
    )


def _with_area(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = points[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return faces[area > 1e-12 + 1e-6 * area.max()]


def _ellipsoid(radii: np.ndarray) -> Surface:
    unit, faces = _globe()
    points, normals = unit * radii, unit / radii
    return (
        points,
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        _with_area(points, faces),
    )


def _capsule(radius: float, half: float) -> Surface:
    unit, _ = _globe()
    # The equator's ring occurs twice: once for each end.
    south, north = unit[: (RINGS // 2 + 1) * AROUND], unit[RINGS // 2 * AROUND :]
    normals = np.concatenate([south, north])
    points = np.concatenate([south * radius - [0, 0, half], north * radius + [0, 0, half]])
    return points, normals, _with_area(points, _rings(RINGS + 2))


def _cylinder(radius: float, half: float) -> Surface:
    around = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around), np.zeros(AROUND)], 1)
    top = np.array([0.0, 0.0, half])
    fan = np.array([[0, i, i + 1] for i in range(1, AROUND - 1)])
    points = np.concatenate([radius * circle - top, radius * circle + top] * 2)
    normals = np.concatenate(
        [
            circle,
            circle,
            np.tile([0.0, 0.0, -1.0], (AROUND, 1)),
            np.tile([0.0, 0.0, 1.0], (AROUND, 1)),
        ]
    )
    return points, normals, np.concatenate([_rings(2), fan[:, ::-1] + 2 * AROUND, fan + 3 * AROUND])


def _box(half: np.ndarray) -> Surface:
    points: list[list[np.ndarray]] = []
    normals: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = side
            u, v = np.roll([1.0, 0.0, 0.0], axis + 1), np.roll([1.0, 0.0, 0.0], axis + 2) * side
            faces.append(np.array([[0, 1, 2], [0, 2, 3]]) + 4 * len(faces))
            points.append(
                [(normal + a * u + b * v) * half for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            )
            normals.append(np.tile(normal, (4, 1)))
    return (
        np.concatenate([np.array(side) for side in points]),
        np.concatenate(normals),
        np.concatenate(faces),
    )


def _mesh(points: np.ndarray, faces: np.ndarray) -> Surface:
    """The surface of a mesh with flat shading: every triangle has its own vertices."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    keep = length > 1e-14
    normals = np.repeat(normals[keep] / length[keep, None], 3, axis=0)
    return corners[keep].reshape(-1, 3), normals, np.arange(3 * int(keep.sum())).reshape(-1, 3)
