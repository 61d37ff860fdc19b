"""Models with welded bodies merged into those that carry them.

A body without a joint needs no place in the equations. Robots have many: sensors, rotors, feet.
"""

import dataclasses
from typing import Any, TypeAlias

import mujoco
import numpy as np

from mjxgait.creature.overlap import Crossings
from mjxgait.physics.layout import SenseLayout


class Fused:
    """Model with merged bodies; all but bodies and places of shapes reads as in the original.

    model: the original. carrier: [nbody] the body here that each original body is part of.
    kept: [n] the original bodies of those here, without the world.
    """

    def __init__(self, model: mujoco.MjModel, kept: np.ndarray) -> None:
        self.model, self.kept = model, kept
        self.carrier, place, turn = _carried(model, kept)
        self.nbody = len(kept) + 1
        rows = [0, *kept]
        self.body_jntadr, self.body_jntnum = model.body_jntadr[rows], model.body_jntnum[rows]
        parents = model.body_parentid[kept]
        self.body_parentid = np.append(0, self.carrier[parents])
        self.body_pos = model.body_pos[rows].copy()
        self.body_quat = model.body_quat[rows].copy()
        for i, (body, parent) in enumerate(zip(kept, parents, strict=True), 1):
            self.body_pos[i] = place[parent] + turn[parent] @ model.body_pos[body]
            self.body_quat[i] = _compose(turn[parent], model.body_quat[body])
        self.jnt_bodyid = self.carrier[model.jnt_bodyid]
        bodies = model.geom_bodyid
        self.geom_bodyid = self.carrier[bodies]
        self.geom_pos = place[bodies] + np.einsum("gij,gj->gi", turn[bodies], model.geom_pos)
        pairs = zip(bodies, model.geom_quat, strict=True)
        self.geom_quat = np.array([_compose(turn[b], quat) for b, quat in pairs])
        self.geom_invweight = model.body_invweight0[bodies, 0]
        self._weigh(place, turn)
        self.place, self.turn = place, turn

    def __getattr__(self, name: str) -> Any:
        return getattr(self.model, name)

    def body(self, place: int) -> Any:
        """Return MuJoCo's body, by its index here."""
        return self.model.body(int(np.append(0, self.kept)[place]))

    def _weigh(self, place: np.ndarray, turn: np.ndarray) -> None:
        """Masses, centres and moments of all that moves together."""
        model, rows = self.model, [0, *self.kept]
        self.body_mass = model.body_mass[rows].copy()
        self.body_ipos, self.body_iquat = (
            model.body_ipos[rows].copy(),
            model.body_iquat[rows].copy(),
        )
        self.body_inertia = model.body_inertia[rows].copy()
        for i in range(1, self.nbody):
            group = np.flatnonzero(self.carrier == i)
            heavy = group[model.body_mass[group] > 0]
            if len(group) == 1 or not len(heavy):
                continue
            mass = model.body_mass[heavy]
            centres = place[heavy] + np.einsum("bij,bj->bi", turn[heavy], model.body_ipos[heavy])
            centre = mass @ centres / mass.sum()
            tensor = np.zeros((3, 3))
            for b, m, c in zip(heavy, mass, centres - centre, strict=True):
                axes = turn[b] @ _matrix(model.body_iquat[b])
                tensor += axes @ np.diag(model.body_inertia[b]) @ axes.T
                tensor += m * (c @ c * np.eye(3) - np.outer(c, c))
            moments, axes = np.linalg.eigh(tensor)
            axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
            self.body_mass[i], self.body_ipos[i] = mass.sum(), centre
            self.body_inertia[i], self.body_iquat[i] = moments, _quaternion(axes)


Model: TypeAlias = Any
"""mujoco.MjModel | Fused"""


def fuse(
    model: mujoco.MjModel, layout: SenseLayout, crossings: Crossings | None
) -> tuple[Model, SenseLayout, Crossings | None]:
    """Merge the welded bodies; return all as it is if none is welded, or in a fluid.

    A fluid resists each body by itself.
    """
    bodies = np.arange(1, model.nbody)
    kept = bodies[(model.body_jntnum[1:] > 0) | (bodies == layout.trunk)]
    if len(kept) == len(bodies) or model.opt.density or model.opt.viscosity:
        return model, layout, crossings
    fused = Fused(model, kept)
    layout = dataclasses.replace(layout, trunk=int(fused.carrier[layout.trunk]))
    if crossings is None or not len(crossings.body):
        return fused, layout, crossings
    place, turn = fused.place[crossings.body], fused.turn[crossings.body]
    return (
        fused,
        layout,
        dataclasses.replace(
            crossings,
            body=fused.carrier[crossings.body],
            centre=place + np.einsum("sij,sj->si", turn, crossings.centre),
            half=np.einsum("sij,sj->si", turn, crossings.half),
        ),
    )


def geom_weights(model: Model, geoms: list[int]) -> np.ndarray:
    """Inverse mass [n] 1/kg that a contact of each geom sees."""
    if isinstance(model, Fused):
        return np.array(model.geom_invweight[geoms])
    return np.array(model.body_invweight0[model.geom_bodyid[geoms], 0])


def _carried(model: mujoco.MjModel, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the carrier [nbody] of each body, and its pose there: [nbody, 3] m, [nbody, 3, 3]."""
    carrier = np.zeros(model.nbody, int)
    place, turn = np.zeros((model.nbody, 3)), np.tile(np.eye(3), (model.nbody, 1, 1))
    for body in range(1, model.nbody):
        if body in kept:
            carrier[body] = int(np.searchsorted(kept, body)) + 1
            continue
        parent = model.body_parentid[body]
        carrier[body] = carrier[parent]
        place[body] = place[parent] + turn[parent] @ model.body_pos[body]
        turn[body] = turn[parent] @ _matrix(model.body_quat[body])
    return carrier, place, turn


def _compose(turn: np.ndarray, quat: np.ndarray) -> np.ndarray:
    """Turn a quaternion; without a turn its numbers stay the same."""
    return quat if np.array_equal(turn, np.eye(3)) else _quaternion(turn @ _matrix(quat))


def _matrix(quat: np.ndarray) -> np.ndarray:
    result = np.zeros(9)
    mujoco.mju_quat2Mat(result, np.asarray(quat, float))
    return result.reshape(3, 3)


def _quaternion(matrix: np.ndarray) -> np.ndarray:
    result = np.zeros(4)
    mujoco.mju_mat2Quat(result, np.ascontiguousarray(matrix, float).ravel())
    return result
