"""Parts of a creature that may change size, and its standing height with other sizes.

Letters: `B` bodies without the world, `Z` sizes: one for both parts of a mirrored pair.
"""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature.creature import Creature, vertical_freedom
from mjxgait.creature.geometry import DOWN, geom_reach, posed, shapes
from mjxgait.creature.load import creature_of
from mjxgait.creature.scale import scaled_files
from mjxgait.errors import UserError

SLIDE = mujoco.mjtJoint.mjJNT_SLIDE


@dataclasses.dataclass(frozen=True, eq=False)
class Proportions:
    """Parts that can change size: all that hang on the trunk; the trunk keeps its size.

    names: of the parts, per size. size_of: [B] index of a body's size, -1 for a body that keeps
    its own. fixed: [S] m, reach: [S, B] m; in the standing pose the lowest points of the S shapes
    are at `fixed + reach @ factors`. upwards: [nq] change that lifts the creature by 1 m.
    """

    names: tuple[tuple[str, ...], ...]
    size_of: np.ndarray
    fixed: np.ndarray
    reach: np.ndarray
    upwards: np.ndarray

    def by_part(self, sizes: np.ndarray) -> dict[str, float]:
        """Factors by part. sizes: [Z] logarithms."""
        factors = np.exp(np.asarray(sizes, float))
        return {n: float(f) for f, names in zip(factors, self.names, strict=True) for n in names}


def proportions(creature: Creature) -> Proportions:
    """The proportions of a creature."""
    model = creature.model
    root = _jointed(model, creature.trunk)
    groups: dict[int, int] = {}
    size_of = np.full(model.nbody - 1, -1)
    names: list[list[str]] = []
    for body in range(1, model.nbody):
        own = _jointed(model, body)
        if own in (root, 0):
            continue
        first = min(own, _partner(creature, own))
        size = groups.setdefault(first, len(groups))
        if size == len(names):
            names.append([])
        names[size].append(model.body(body).name)
        size_of[body - 1] = size
    return Proportions(
        tuple(map(tuple, names)), size_of, *_heights(creature), vertical_freedom(model)
    )


def grown(creature: Creature, sizes: Mapping[str, float]) -> Creature:
    """Return the creature with parts scaled by these factors; its stated body length stays.

    Raises:
      UserError: such a body is not possible.
    """
    if not sizes:
        return creature
    # Steering is in body lengths, those of the creature that evolved.
    files = scaled_files(creature.files, sizes, body_length=creature.frame.body_length)
    return dataclasses.replace(creature_of(files), terrain=creature.terrain)


def extreme_bodies(creature: Creature, most: float) -> list[Creature]:
    """Return the smallest and the largest body that evolution may try; none where `most` is 1.

    Raises:
      UserError: one of them is not possible; says why.
    """
    if most == 1.0:
        return []
    parts = [name for names in proportions(creature).names for name in names]
    if not all(parts):
        raise UserError(
            "--evolve-body: a part of creature.xml has no name, by which the run would keep its "
            "size; give every body one"
        )
    try:
        return [grown(creature, dict.fromkeys(parts, factor)) for factor in (1 / most, most)]
    except UserError as error:
        raise UserError(f"--evolve-body {most:g}: {error}") from None


def _jointed(model: mujoco.MjModel, body: int) -> int:
    """The body with a joint that a body is welded to, or the world."""
    return int(model.body_weldid[body])


def _partner(creature: Creature, body: int) -> int:
    """The mirror image of a body with joints, by its first actuated joint."""
    model = creature.model
    on = np.flatnonzero(model.dof_bodyid[creature.joints.dof_adr] == body)
    if not len(on):
        return body
    return int(model.dof_bodyid[creature.joints.dof_adr[creature.mirror.partner[on[0]]]])


def _heights(creature: Creature) -> tuple[np.ndarray, np.ndarray]:
    """Height of each colliding shape's lowest point: constant part, and slope per factor.

    A body's own lengths (its shapes, joints and the places of its children) grow by its factor, and
    orientations stay, so a height is a sum over the chain from the trunk.
    """
    model = creature.model
    data = posed(model, creature.stand_qpos)
    bodies = model.nbody
    fixed, reach = np.zeros(bodies), np.zeros((bodies, bodies))
    for body in range(1, bodies):
        parent = int(model.body_parentid[body])
        if parent == 0:
            fixed[body] = data.xpos[body, 2]
            continue
        place = data.xmat[parent].reshape(3, 3)[2] @ model.body_pos[body]
        slid = _slid(model, data, body)
        fixed[body] = fixed[parent] + slid
        reach[body] = reach[parent]
        reach[body, parent] += place
        reach[body, body] += data.xpos[body, 2] - data.xpos[parent, 2] - place - slid
    geoms = shapes(model)
    rows = reach[model.geom_bodyid[geoms]].copy()
    for row, g in zip(rows, geoms, strict=True):
        body = int(model.geom_bodyid[g])
        row[body] += -geom_reach(model, data, g, DOWN) - data.xpos[body, 2]
    return fixed[model.geom_bodyid[geoms]], rows[:, 1:]


def _slid(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float:
    """Height in m by which a body's slides have lifted it."""
    first = int(model.body_jntadr[body])
    joints = range(first, first + int(model.body_jntnum[body]))
    return sum(
        float(data.qpos[q] - model.qpos0[q]) * float(data.xaxis[j, 2])
        for j in joints
        if model.jnt_type[j] == SLIDE
        for q in [model.jnt_qposadr[j]]
    )
