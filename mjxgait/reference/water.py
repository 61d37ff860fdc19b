"""Water in C MuJoCo: drag at points of every block's faces, summed per body.

Written from docs/blocks.md. Letters: `S` simulations, `B` blocks, `Q` points of a block's faces.
"""

import mujoco
import numpy as np
from mujoco.batch import Batch

PLACES = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
SHARES = np.array([5.0, 8.0, 5.0]) / 18
"""Gauss points on an edge from -1 to 1 and their weights: exact for this drag."""


class Water:
    """Drag along the normal of a face, against each point's velocity along it.

    drag: N·s/m³, force per area and velocity.
    """

    def __init__(self, model: mujoco.MjModel, drag: float) -> None:
        self.drag = drag
        box = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        self.blocks = np.flatnonzero(box & (model.geom_bodyid > 0))
        self.bodies = model.geom_bodyid[self.blocks]
        self.roots = model.body_rootid[self.bodies]
        half = model.geom_size[self.blocks]
        points, normals, areas = [], [], []
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            for side in (-1.0, 1.0):
                for u, share_u in zip(PLACES, SHARES, strict=True):
                    for v, share_v in zip(PLACES, SHARES, strict=True):
                        place = np.zeros(3)
                        place[[axis, i, j]] = side, u, v
                        points.append(place * half)
                        normals.append(side * np.eye(3)[axis])
                        areas.append(4 * half[:, i] * half[:, j] * share_u * share_v)
        self.points = np.stack(points, axis=1)
        self.normals = np.stack(normals)
        self.areas = np.stack(areas, axis=1)

    def forces(
        self,
        geom_xpos: np.ndarray,
        geom_xmat: np.ndarray,
        cvel: np.ndarray,
        subtree_com: np.ndarray,
        xipos: np.ndarray,
    ) -> np.ndarray:
        """Return N, N·m [S, nbody, 6] about each body's centre of mass; arrays as in `MjData`."""
        count = len(geom_xpos)
        rotation = geom_xmat[:, self.blocks].reshape(count, -1, 3, 3)
        arms = np.einsum("sbij,bqj->sbqi", rotation, self.points)
        points = geom_xpos[:, self.blocks, None] + arms
        normals = np.einsum("sbij,qj->sbqi", rotation, self.normals)
        spin, shift = cvel[:, self.bodies, None, :3], cvel[:, self.bodies, None, 3:]
        # MuJoCo gives a body's velocity at the centre of mass of its whole tree.
        velocity = shift + np.cross(spin, points - subtree_com[:, self.roots, None])
        along = (velocity * normals).sum(3, keepdims=True)
        force = -self.drag * self.areas[:, :, None] * along * normals
        moment = np.cross(points - xipos[:, self.bodies, None], force)
        found = np.zeros((count, xipos.shape[1], 6))
        pushed = np.concatenate([force, moment], axis=3).sum(2)
        for block, body in enumerate(self.bodies):
            found[:, body] += pushed[:, block]
        return found


class Bath:
    """Water around simulations that are stepped together. drag: N·s/m³."""

    def __init__(self, model: mujoco.MjModel, batch: Batch, drag: float) -> None:
        self.water, self.force = Water(model, drag), batch.bind("xfrc_applied")
        names = ("geom_xpos", "geom_xmat", "cvel", "subtree_com", "xipos")
        self.seen = tuple(batch.bind(name) for name in names)

    def press(self, rows: np.ndarray) -> None:
        """Apply the water's force to some simulations, at their current velocities."""
        self.force[rows] = self.water.forces(*(array[rows] for array in self.seen))
