"""Ray intersections and silhouettes of MuJoCo's shapes for a camera with parallel rays.

Letters: `N` rays, `G` geoms, `K` directions.
"""

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from mjxgait.creature.geometry import support_extents

if TYPE_CHECKING:
    from mjxgait.rendering.painter import _Canvas, _Paint

GEOM = mujoco.mjtGeom
MISS = np.inf
Z = np.array([0.0, 0.0, 1.0], dtype=np.float32)
TOUCH = 1e-5
"""Distance from a cylinder's end below which a point lies on it, in half lengths."""


class Silhouettes:
    """Outlines of geoms from their support functions: sums of a sphere, a box and an ellipsoid."""

    def __init__(self, model: mujoco.MjModel, geoms: np.ndarray) -> None:
        parts = [support_extents(model.geom_type[g], model.geom_size[g]) for g in geoms]
        self.ball = np.array([p[0] for p in parts])[:, None, None]
        self.box = np.array([p[1] for p in parts])[:, None]
        self.ellipsoid = np.array([p[2] for p in parts])[:, None]

    def outermost(self, pos: np.ndarray, rot: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return the outermost points [..., G, K, 3] m of geoms along unit directions [K, 3].

        pos: [..., G, 3] m. rot: [..., G, 3, 3].
        """
        local = directions @ rot
        stretched = local * self.ellipsoid
        length = np.maximum(np.linalg.norm(stretched, axis=-1, keepdims=True), 1e-12)
        inner = np.sign(local) * self.box + stretched * self.ellipsoid / length
        return pos[..., None, :] + self.ball * directions + inner @ rot.swapaxes(-1, -2)


def distances(
    kind: int, size: np.ndarray, origins: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Return how far parallel rays go until they enter a primitive, in its own frame.

    Args:
      origins: [N, 3] m. direction: [3] unit. Single precision will do if they begin near it.

    Returns:
      [N] m, infinite for a miss.
    """
    match kind:
        case GEOM.mjGEOM_SPHERE:
            return _ellipsoid(np.repeat(size[:1], 3), origins, direction)
        case GEOM.mjGEOM_ELLIPSOID:
            return _ellipsoid(size, origins, direction)
        case GEOM.mjGEOM_CAPSULE:
            return _capsule(float(size[0]), float(size[1]), origins, direction)
        case GEOM.mjGEOM_CYLINDER:
            return _cylinder(float(size[0]), float(size[1]), origins, direction)
        case _:
            return _box(size, origins, direction)


def normals(kind: int, size: np.ndarray, points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the normals [n, 3] of a primitive where rays enter it, at points [n, 3] m."""
    match kind:
        case GEOM.mjGEOM_SPHERE:
            return points / size[0]
        case GEOM.mjGEOM_ELLIPSOID:
            return _unit(points / size**2)
        case GEOM.mjGEOM_CAPSULE:
            axis = np.clip(points[:, 2], -size[1], size[1])
            return _unit(points - axis[:, None] * Z)
        case GEOM.mjGEOM_CYLINDER:
            cap = np.abs(points[:, 2]) > (1 - TOUCH) * size[1]
            facing = -np.sign(direction[2]) or 1.0
            return np.where(cap[:, None], facing * Z, _unit(points * [1.0, 1.0, 0.0]))
        case _:
            face = np.abs(points / size).argmax(1)
            normal = np.zeros_like(points)
            normal[np.arange(len(face)), face] = -np.sign(direction)[face]
            return normal


def _ellipsoid(radii: np.ndarray, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    o, d = origins / radii, direction / radii
    return _first_root(d @ d, o @ d, _squared(o) - 1)


def _capsule(radius: float, half: float, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Nearest hit of the side and the two round ends."""
    side = _side(radius, half, origins, direction)
    # Both ends share all but what depends on their height.
    b, c = origins @ direction, _squared(origins) - radius**2 + half**2
    z = 2 * half * origins[:, 2]
    ends = [_first_root(1.0, b - end * direction[2], c - np.sign(end) * z) for end in (-half, half)]
    return np.minimum(side, np.minimum(*ends))


def _cylinder(radius: float, half: float, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    side = _side(radius, half, origins, direction)
    facing = -np.sign(direction[2]) or 1.0
    cap = (facing * half - origins[:, 2]) / (direction[2] if direction[2] else 1e-12)
    x, y = (origins[:, i] + cap * direction[i] for i in range(2))
    return np.minimum(side, np.where(x**2 + y**2 <= radius**2, cap, MISS))


def _box(half: np.ndarray, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Hit by the slab method."""
    slope = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
    near = [(-np.sign(slope[i]) * half[i] - origins[:, i]) / slope[i] for i in range(3)]
    far = [(np.sign(slope[i]) * half[i] - origins[:, i]) / slope[i] for i in range(3)]
    enters = np.maximum(np.maximum(near[0], near[1]), near[2])
    leaves = np.minimum(np.minimum(far[0], far[1]), far[2])
    return np.where(enters <= leaves, enters, MISS)


def _side(radius: float, half: float, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Distance to the round side of a cylinder about z."""
    steep = float(direction[:2] @ direction[:2])
    if steep < 1e-12:
        return np.full(len(origins), MISS)
    x, y, z = origins.T
    b = x * direction[0] + y * direction[1]
    side = _first_root(steep, b, x * x + y * y - radius**2)
    along = z + np.where(np.isfinite(side), side, 0.0) * direction[2]
    return np.where(np.abs(along) <= half, side, MISS)


def _first_root(a: float, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Smaller root of `a t² + 2 b t + c`; infinite if there is none."""
    inside = b * b - a * c
    return np.where(inside >= 0, (-b - np.sqrt(np.maximum(inside, 0))) / a, MISS)


def _squared(vectors: np.ndarray) -> np.ndarray:
    """Squared lengths [N]; several times as fast as a sum over so short an axis."""
    x, y, z = vectors.T
    squared: np.ndarray = x * x + y * y + z * z
    return squared


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.sqrt(_squared(vectors)), 1e-12)[:, None]


def fill_mesh(
    canvas: "_Canvas",
    model: mujoco.MjModel,
    geom: int,
    pos: np.ndarray,
    rot: np.ndarray,
    paint: "_Paint",
) -> None:
    """Draw a mesh geom at pos [3] m and rot [3, 3] on a painter's canvas."""
    points, faces = mesh_of(model, geom)
    world = points @ rot.T + pos
    corners = world[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    flat, depth = canvas.camera.pixels(world)[faces], canvas.camera.depth(world)[faces]
    for i in np.flatnonzero(normals @ canvas.camera.axes[2] < 0):
        _fill(canvas, flat[i], depth[i], normals[i], paint)


def mesh_of(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh geom's points [V, 3] m in its own frame and triangles [F, 3]."""
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return model.mesh_vert[first : first + count].astype(float), model.mesh_face[
        face : face + faces
    ]


def _fill(
    canvas: "_Canvas", flat: np.ndarray, depth: np.ndarray, normal: np.ndarray, paint: "_Paint"
) -> None:
    """Fill one triangle. flat: [3, 2] pixels. depth: [3] m."""
    x0, y0 = np.maximum(np.floor(flat.min(0)).astype(int), 0)
    x1, y1 = np.minimum(
        np.ceil(flat.max(0)).astype(int) + 1, [canvas.camera.width, canvas.camera.height]
    )
    edges = np.column_stack([flat[1] - flat[0], flat[2] - flat[0]])
    if x0 >= x1 or y0 >= y1 or abs(np.linalg.det(edges)) < 1e-9:
        return
    # Both coordinates along the edges grow evenly over the picture.
    (bx, by), (cx, cy) = np.linalg.inv(edges)
    x, y = np.arange(x0, x1) + 0.5 - flat[0, 0], (np.arange(y0, y1) + 0.5 - flat[0, 1])[:, None]
    b, c = bx * x + by * y, cx * x + cy * y
    inside = (b >= -1e-6) & (c >= -1e-6) & (b + c <= 1 + 1e-6)
    if not inside.any():
        return
    distance = np.where(
        inside, depth[0] + b * (depth[1] - depth[0]) + c * (depth[2] - depth[0]), np.inf
    )
    canvas.cover((slice(y0, y1), slice(x0, x1)), distance, lambda covered: normal[None], paint)
