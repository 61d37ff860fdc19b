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


def hit(
    kind: int, size: np.ndarray, origins: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points at which parallel rays enter a primitive, in its own frame.

    Args:
      origins: [N, 3] m. direction: [3] unit.

    Returns:
      distance [N] along the ray in m, infinite for a miss; normal [N, 3].
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


def _ellipsoid(
    radii: np.ndarray, origins: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    o, d = origins / radii, direction / radii
    distance = _first_root(d @ d, o @ d, (o * o).sum(1) - 1)
    return distance, _unit((o + _reach(distance)[:, None] * d) / radii)


def _capsule(
    radius: float, half: float, origins: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Nearest hit of the side and the two round ends."""
    side = _side(radius, origins, direction)
    along = origins[:, 2] + _reach(side) * direction[2]
    side = np.where(np.abs(along) <= half, side, MISS)
    ends = []
    for centre in (-half, half):
        o = origins - [0.0, 0.0, centre]
        ends.append(_first_root(1.0, o @ direction, (o * o).sum(1) - radius**2))
    distance = np.minimum(side, np.minimum(*ends))
    points = origins + _reach(distance)[:, None] * direction
    axis = np.clip(points[:, 2], -half, half)
    return distance, _unit(points - axis[:, None] * [0.0, 0.0, 1.0])


def _cylinder(
    radius: float, half: float, origins: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    side = _side(radius, origins, direction)
    side = np.where(np.abs(origins[:, 2] + _reach(side) * direction[2]) <= half, side, MISS)
    facing = -np.sign(direction[2]) or 1.0
    cap = (facing * half - origins[:, 2]) / (direction[2] if direction[2] else 1e-12)
    on_cap = origins[:, :2] + cap[:, None] * direction[:2]
    cap = np.where((on_cap**2).sum(1) <= radius**2, cap, MISS)
    distance = np.minimum(side, cap)
    points = origins + _reach(distance)[:, None] * direction
    round_normal = _unit(points * [1.0, 1.0, 0.0])
    return distance, np.where((cap < side)[:, None], [0.0, 0.0, facing], round_normal)


def _box(
    half: np.ndarray, origins: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Hit by the slab method."""
    slope = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
    near = (-np.sign(slope) * half - origins) / slope
    far = (np.sign(slope) * half - origins) / slope
    enters, leaves = near.max(1), far.min(1)
    normal = np.zeros_like(origins)
    face = near.argmax(1)
    normal[np.arange(len(face)), face] = -np.sign(slope)[face]
    return np.where(enters <= leaves, enters, MISS), normal


def _side(radius: float, origins: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Distance to the infinite cylinder about z."""
    o, d = origins[:, :2], direction[:2]
    steep = float(d @ d)
    if steep < 1e-12:
        return np.full(len(origins), MISS)
    return _first_root(steep, o @ d, (o * o).sum(1) - radius**2)


def _first_root(a: float, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Smaller root of `a t² + 2 b t + c`; infinite if there is none."""
    inside = b * b - a * c
    return np.where(inside >= 0, (-b - np.sqrt(np.maximum(inside, 0))) / a, MISS)


def _reach(distance: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(distance), distance, 0.0)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)


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
    x, y = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
    b, c = np.linalg.solve(edges, np.stack([x.ravel() - flat[0, 0], y.ravel() - flat[0, 1]]))
    inside = (b >= -1e-6) & (c >= -1e-6) & (b + c <= 1 + 1e-6)
    distance = np.where(
        inside, depth[0] + b * (depth[1] - depth[0]) + c * (depth[2] - depth[0]), np.inf
    ).reshape(x.shape)
    canvas.cover(
        (slice(y0, y1), slice(x0, x1)), distance, np.broadcast_to(normal, (*x.shape, 3)), paint
    )
