"""Meshes for the painter: triangles that face the camera are filled, tested by depth."""

from typing import Any

import mujoco
import numpy as np


def fill_mesh(
    canvas: Any, model: mujoco.MjModel, geom: int, pos: np.ndarray, rot: np.ndarray, paint: Any
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


def _fill(canvas: Any, flat: np.ndarray, depth: np.ndarray, normal: np.ndarray, paint: Any) -> None:
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
