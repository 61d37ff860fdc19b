"""Distances between the blocks of one body, written from docs/reference/modular-bodies.md.

Letters: `S` simulations, `G` blocks, `P` pairs of blocks.
"""

import itertools

import mujoco
import numpy as np


class OwnContact:
    """Pairs of blocks of one body that collide: all but those with a single joint between them.

    geoms: boxes of the body.
    """

    def __init__(self, model: mujoco.MjModel, geoms: np.ndarray) -> None:
        self.geoms, self.half = geoms, model.geom_size[geoms]
        rigid = model.body_weldid[model.geom_bodyid[geoms]]
        above = model.body_weldid[model.body_parentid[rigid]]
        self.pairs = [
            (i, j)
            for i, j in itertools.combinations(range(len(geoms)), 2)
            if rigid[i] != rigid[j] and rigid[i] != above[j] and rigid[j] != above[i]
        ]

    def gaps(self, xpos: np.ndarray, xmat: np.ndarray) -> np.ndarray:
        """Return the distance [S, G] in m from each block to the nearest other one.

        Along their six normals; negative inside it, infinite without another. xpos: [S, ngeom, 3],
        xmat: [S, ngeom, 9] of all geoms.
        """
        found = np.full((len(xpos), len(self.geoms)), np.inf)
        if not self.pairs:
            return found
        middle = xpos[:, self.geoms]
        axes = xmat[:, self.geoms].reshape(*middle.shape, 3)
        i, j = np.array(self.pairs).T
        between = middle[:, i] - middle[:, j]
        turned = np.abs(np.einsum("spkx,spky->spxy", axes[:, i], axes[:, j]))
        first = self.half[i] + np.einsum("spxy,py->spx", turned, self.half[j])
        second = self.half[j] + np.einsum("spxy,px->spy", turned, self.half[i])
        apart = np.maximum(
            (np.abs(np.einsum("spkx,spk->spx", axes[:, i], between)) - first).max(2),
            (np.abs(np.einsum("spkx,spk->spx", axes[:, j], between)) - second).max(2),
        )
        for first_block, second_block, distance in zip(i, j, apart.T, strict=True):
            for block in (first_block, second_block):
                found[:, block] = np.minimum(found[:, block], distance)
        return found
