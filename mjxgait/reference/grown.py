"""Measurements of recorded motions of modular bodies.

Letters: `T` frames, `G` blocks.
"""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.reference.contest import contest_of


@dataclasses.dataclass(frozen=True, eq=False)
class Grown:
    """Measurements of a modular body, in world axes.

    middle: [T, 3] m, centre of mass. momentum: [T, 3] N·s. push: [T, 3] N, total water force.
    low: [T] m, lowest point of all blocks. buried: [T] greatest depth of a block in the ground, as
    a share of its size. folded: [T] greatest depth of a block's far end in the block on which it
    turns, as a share of the smaller size. sizes: m by name of the part, cube root of its volume.
    gaps: [T, 2] m from the cube's middle to the nearest block of the body and of its opponent; NaN
    without a cube.
    """

    middle: np.ndarray
    momentum: np.ndarray
    push: np.ndarray
    low: np.ndarray
    buried: np.ndarray
    folded: np.ndarray
    sizes: Mapping[str, float]
    gaps: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))

    def window(self, frames: slice) -> "Grown":
        """Return some of the frames."""
        arrays = {
            f.name: getattr(self, f.name)[frames]
            for f in dataclasses.fields(self)
            if f.name != "sizes"
        }
        return Grown(**arrays, sizes=self.sizes)


def seen_grown(creature: Creature, qpos: np.ndarray, qvel: np.ndarray, drag: float) -> Grown:
    """Measure a motion [T, nq], [T, nv]; frames after it blew up are NaN.

    drag: N·s/m³ of the water; 0 without. The velocity of a block's middle along the normal gives
    the force on a face (docs/reference/modular-bodies.md); the reference simulator sums points
    instead.
    """
    model, data = creature.model, mujoco.MjData(creature.model)
    boxes = np.flatnonzero(model.body_rootid[model.geom_bodyid] == creature.trunk)
    half, size = model.geom_size[boxes], np.cbrt(8 * model.geom_size[boxes].prod(1))
    middle, momentum, push = (np.full((len(qpos), 3), np.nan) for _ in range(3))
    low, buried, folded = (np.full(len(qpos), np.nan) for _ in range(3))
    gaps, contest = np.full((len(qpos), 2), np.nan), contest_of(creature)
    joined = _joined(model, boxes)
    velocity = np.zeros(6)
    for k in np.flatnonzero(np.isfinite(qpos).all(1) & np.isfinite(qvel).all(1)):
        data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        momentum[k] = push[k] = 0.0
        for box in boxes:
            kind, mass = mujoco.mjtObj.mjOBJ_GEOM, model.body_mass[model.geom_bodyid[box]]
            mujoco.mj_objectVelocity(model, data, kind, box, velocity, 0)
            momentum[k] += mass * velocity[3:]
            push[k] += _push(model.geom_size[box], data.geom_xmat[box], velocity[3:], drag)
        middle[k] = data.subtree_com[creature.trunk]
        reach = (np.abs(data.geom_xmat[boxes, 6:]) * half).sum(1)
        lows = data.geom_xpos[boxes, 2] - reach
        low[k], buried[k] = lows.min(), (-lows / size).max()
        if contest is not None:
            gaps[k] = contest.gaps(data.geom_xpos[None], data.geom_xmat[None])[0]
        ends = _far_ends(data, model, boxes)
        folded[k] = max(
            (_depth(data, model, ends[i], boxes[j]) / min(size[i], size[j]) for i, j in joined),
            default=0.0,
        )
    names = [model.body(model.geom_bodyid[box]).name for box in boxes]
    sizes = dict(zip(names, size.tolist(), strict=True))
    buried, folded = np.maximum(buried, 0.0), np.maximum(folded, 0.0)
    return Grown(middle, momentum, push, low, buried, folded, sizes, gaps)


def _joined(model: mujoco.MjModel, boxes: np.ndarray) -> list[tuple[int, int]]:
    """Places in `boxes` of a block and one further in, for pairs with a single joint between."""
    place = {int(model.geom_bodyid[box]): i for i, box in enumerate(boxes)}
    found = []
    for body, i in place.items():
        joints, above = 0, body
        while above in place and joints < 2:
            joints += int(model.body_jntnum[above] > 0)
            above = int(model.body_parentid[above])
            if joints == 1 and above in place:
                found.append((i, place[above]))
    return found


def _far_ends(data: mujoco.MjData, model: mujoco.MjModel, boxes: np.ndarray) -> np.ndarray:
    """Points [G, 3] m of the blocks that are farthest from their joints, along their middles."""
    ends: np.ndarray = 2 * data.geom_xpos[boxes] - data.xpos[model.geom_bodyid[boxes]]
    return ends


def _depth(data: mujoco.MjData, model: mujoco.MjModel, point: np.ndarray, box: int) -> float:
    """Depth in m of a point in a box; negative outside."""
    inward = (point - data.geom_xpos[box]) @ data.geom_xmat[box].reshape(3, 3)
    return float((model.geom_size[box] - np.abs(inward)).min())


def _push(half: np.ndarray, rotation: np.ndarray, velocity: np.ndarray, drag: float) -> np.ndarray:
    """Return the force [3] in N on a block with this velocity of its middle."""
    normals = rotation.reshape(3, 3)
    # Each area is that of two opposite faces.
    areas = 8 * half[[1, 2, 0]] * half[[2, 0, 1]]
    pushed: np.ndarray = -drag * normals @ (areas * (velocity @ normals))
    return pushed
