"""Indices and frames of a MuJoCo model, and heights of its lowest points.

Uses MuJoCo's distances between the true shapes, including visual-only geoms.
Letters: `S` simulations, `G` geoms.
"""

import dataclasses
from typing import Protocol

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.geometry import posed, support_extents

FLOOR = "floor"


class Ground(Protocol):
    """Ground other than the plane z = 0; places and heights in m, of any shape."""

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return heights at places in the world."""
        ...

    def steepness(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the change [2, ...] of the height per metre along x and y."""
        ...


class Layout:
    """Indices of the free root, and row and column of each stored mass matrix entry.

    MuJoCo stores the lower triangle.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        free = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
        self.root_qpos = int(model.jnt_qposadr[free][0])
        self.root_dof = int(model.jnt_dofadr[free][0])
        self.mass_row = np.repeat(np.arange(model.nv), model.M_rownnz)
        self.mass_column = model.M_colind.copy()

    def dense(self, lower: np.ndarray) -> np.ndarray:
        """Return mass matrices [S, nv, nv] from their stored entries [S, nM]."""
        size = int(self.mass_row[-1]) + 1
        full = np.zeros((len(lower), size, size))
        full[:, self.mass_row, self.mass_column] = lower
        full[:, self.mass_column, self.mass_row] = lower
        return full


@dataclasses.dataclass(frozen=True, eq=False)
class StartFrame:
    """Place where the trunk starts, and its horizontal forward and left there; [3] each."""

    place: np.ndarray
    forward: np.ndarray
    left: np.ndarray


def start_frame(creature: Creature) -> StartFrame:
    """Compute the start frame from the standing pose with MuJoCo's kinematics."""
    data = posed(creature.model, creature.stand_qpos)
    rot = data.xmat[creature.trunk].reshape(3, 3)
    forward, left = (
        _horizontal(rot @ axis) for axis in (creature.frame.forward, creature.frame.left)
    )
    return StartFrame(data.xpos[creature.trunk].copy(), forward, left)


def _horizontal(vector: np.ndarray) -> np.ndarray:
    flat = vector * [1.0, 1.0, 0.0]
    return flat / np.linalg.norm(flat)


def per_foot(creature: Creature, heights: np.ndarray) -> np.ndarray:
    """Return the least height [S, F] of each foot from the heights [S, geoms] of its geoms."""
    feet = range(len(creature.feet.names))
    return np.stack([heights[:, creature.feet.foot_of == foot].min(1) for foot in feet], 1)


def foot_middles(creature: Creature, places: np.ndarray) -> np.ndarray:
    """Return the middle [S, F, 3] of each foot's geoms in m. places: [S, ngeom, 3] of all geoms."""
    feet = creature.feet
    own = places[:, list(feet.stepping)]
    return np.stack([own[:, feet.foot_of == foot].mean(1) for foot in range(len(feet.names))], 1)


def level_nose(creature: Creature, trunk_rot: np.ndarray) -> np.ndarray:
    """Return horizontal unit vectors [S, 3] along the nose of trunks [S, 3, 3]."""
    nose = trunk_rot @ creature.frame.forward * [1, 1, 0]
    level: np.ndarray = nose / np.maximum(np.linalg.norm(nose, axis=1, keepdims=True), 1e-6)
    return level


class LowestPoint:
    """Height of geoms' lowest points above the ground, exact for MuJoCo's primitive shapes.

    On uneven ground it is the distance to the tangent plane below that point.
    """

    def __init__(
        self, model: mujoco.MjModel, geoms: np.ndarray, ground: Ground | None = None
    ) -> None:
        self.geoms, self.ground = geoms, ground
        self.floor = 0.0 if ground else float(model.geom(FLOOR).pos[2])
        extents = [support_extents(int(model.geom_type[g]), model.geom_size[g]) for g in geoms]
        self.radius = np.array([r for r, _, _ in extents])
        self.box = np.array([b for _, b, _ in extents]).reshape(-1, 3)
        self.ellipsoid = np.array([e for _, _, e in extents]).reshape(-1, 3)

    def heights(self, xpos: np.ndarray, xmat: np.ndarray) -> np.ndarray:
        """Return heights [S, geoms] in m. xpos: [S, ngeom, 3], xmat: [S, ngeom, 9] of all geoms."""
        if self.ground:
            return self._above(self.ground, xpos[:, self.geoms], xmat[:, self.geoms])
        down = np.abs(xmat[:, self.geoms, 6:])
        reach = (
            self.radius + (down * self.box).sum(2) + np.sqrt(((down * self.ellipsoid) ** 2).sum(2))
        )
        return xpos[:, self.geoms, 2] - reach - self.floor

    def _above(self, ground: Ground, pos: np.ndarray, rot: np.ndarray) -> np.ndarray:
        """Return heights [S, geoms] in m above `ground`. pos: [S, geoms, 3]. rot: [S, geoms, 9]."""
        down = rot[..., 6:]
        round_part = down * self.ellipsoid
        length = np.maximum(np.linalg.norm(round_part, axis=2, keepdims=True), 1e-9)
        point = -(np.sign(down) * self.box + round_part * self.ellipsoid / length)
        turned = (rot.reshape(*rot.shape[:2], 3, 3) @ point[..., None])[..., 0]
        x, y, z = np.moveaxis(pos + turned, -1, 0)
        upright = 1 / np.sqrt(1 + (ground.steepness(x, y) ** 2).sum(0))
        return (z - ground.height(x, y)) * upright - self.radius

    def lowest(self, xpos: np.ndarray, xmat: np.ndarray) -> np.ndarray:
        """Return the least of `heights`, [S] m; infinite without geoms."""
        return self.heights(xpos, xmat).min(1, initial=np.inf)


def own_directions(there: np.ndarray, xmat: np.ndarray) -> np.ndarray:
    """Return directions [S, G, 3] in the own axes of geoms; zero where `there` is.

    there: [S, G, 3] m, from each geom. xmat: [S, G, 9].
    """
    there = there / np.maximum(np.linalg.norm(there, axis=2, keepdims=True), 1e-9)
    seen: np.ndarray = (there[:, :, None] @ xmat.reshape(*there.shape, 3))[:, :, 0]
    return seen


def colliding_geoms(model: mujoco.MjModel) -> np.ndarray:
    """Return the ids of the moving geoms that can collide."""
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return np.flatnonzero(solid & (model.geom_bodyid != 0))
