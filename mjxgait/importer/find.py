"""Anatomy of a compiled model; models that cannot be a creature are refused."""

import dataclasses
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature.geometry import ancestors, posed, subtree
from mjxgait.errors import UserError, listed, matches, matching
from mjxgait.importer.anatomy import (
    HINGE,
    SLIDE,
    Anatomy,
    find_root,
    measured,
    report_root_joints,
    unit_length,
    up_axis,
)
from mjxgait.importer.arms import arms_of, hung, shoulder_of
from mjxgait.importer.legs import (
    NoLegs,
    find_feet,
    lowered_limbs,
    movable_joints,
)
from mjxgait.importer.notes import Notes
from mjxgait.importer.shapes import shapes_of
from mjxgait.importer.spec import copy_bodies

MOST_BODIES, MOST_JOINTS = 400, 60
ENOUGH = 6
"""Joints kept per leg if all legs together have more than may move."""


def find_anatomy(
    model: mujoco.MjModel,
    coupled: Sequence[str],
    keep: Sequence[str],
    freeze: Sequence[str],
    up: str | None,
    notes: Notes,
    limbs: frozenset[str] | None = None,
) -> Anatomy:
    """Find the anatomy of a compiled model.

    Args:
      coupled: names of joints that follow others. keep, freeze: patterns of joints that the user
        wants active or frozen. limbs: see `Source`.

    Raises:
      UserError: the model is no creature that can walk; says why.
    """
    _check_size(model)
    root = find_root(model)
    bodies = subtree(model, root)
    scale = unit_length(model, bodies, notes)
    qpos = _reference_pose(model)
    axis = up_axis(model, bodies, root, qpos, up, notes)
    spec = copy_bodies(model, bodies, scale)
    shapes = {b: shapes_of(spec, spec.bodies[i + 1], i) for i, b in enumerate(bodies)}
    anatomy = measured(model, qpos, axis, scale, spec, shapes)
    report_root_joints(model, root, notes)
    _check_patterns(model, keep, freeze)
    movable = movable_joints(model, anatomy, coupled, freeze, notes)
    try:
        anatomy.feet = find_feet(model, anatomy, movable, limbs)
    except NoLegs as error:
        lowered = lowered_limbs(model, anatomy, movable)
        anatomy = measured(model, lowered, axis, scale, spec, shapes)
        anatomy.lowered = True
        anatomy.feet = find_feet(model, anatomy, movable, limbs)
        if len(anatomy.feet) < 2:  # an arm on its base can reach down too
            raise UserError(str(error)) from None
    if limbs is None:
        anatomy = _with_arms(model, anatomy, movable, axis, notes)
    _choose_joints(model, anatomy, movable, keep, notes)
    _check_loops(model, anatomy)
    return anatomy


def _reference_pose(model: mujoco.MjModel) -> np.ndarray:
    """The file's zero pose [nq]; a joint outside its range there is set to the middle."""
    qpos = model.qpos0.copy()
    for j in range(model.njnt):
        a, (low, high) = int(model.jnt_qposadr[j]), model.jnt_range[j]
        if int(model.jnt_type[j]) in (HINGE, SLIDE) and low < high and not low <= qpos[a] <= high:
            qpos[a] = (low + high) / 2
    return qpos


def _check_size(model: mujoco.MjModel) -> None:
    if model.nbody > MOST_BODIES:
        raise UserError(
            f"the model has {model.nbody} bodies; more than {MOST_BODIES} is not one creature"
        )
    arrays = (
        model.body_pos,
        model.body_mass,
        model.body_inertia,
        model.jnt_range,
        model.geom_size,
        model.geom_pos,
        model.qpos0,
    )
    if not all(
        np.isfinite(a).all() and np.abs(a, dtype=float).max(initial=0) < 1e9 for a in arrays
    ):
        raise UserError(
            "the model has numbers that are infinite, not a number or absurdly large; correct them "
            "in the file"
        )


def _check_patterns(model: mujoco.MjModel, keep: Sequence[str], freeze: Sequence[str]) -> None:
    """Refuse a pattern that matches no joint: it would do nothing, without a word."""
    names = [model.joint(j).name for j in range(model.njnt)]
    for option, patterns in (("--keep", keep), ("--freeze", freeze)):
        for pattern in patterns:
            matching(pattern, names, "joint of the file", option)


def _with_arms(
    model: mujoco.MjModel,
    anatomy: Anatomy,
    movable: list[int],
    axis: np.ndarray,
    notes: Notes,
) -> Anatomy:
    """Return the anatomy of a figure on two legs with arms that hang and may swing."""
    arms = arms_of(model, anatomy, movable)
    if not arms:
        return anatomy
    pose = hung(model, anatomy, arms)
    shoulders = [shoulder_of(model, anatomy, pose, arm) for arm in arms]
    changed = measured(model, pose, axis, anatomy.scale, anatomy.spec, anatomy.shapes)
    swinging = sorted(itertools.chain(*shoulders)) if all(shoulders) else []
    names = listed([model.body(arm.bodies[0]).name for arm in arms])
    notes.guess(f"arms from {names} on", "hang", "medium", "a figure on two legs lets them hang")
    return dataclasses.replace(
        changed, feet=anatomy.feet, lowered=anatomy.lowered, swinging=swinging
    )


def _choose_joints(
    model: mujoco.MjModel, anatomy: Anatomy, movable: list[int], keep: Sequence[str], notes: Notes
) -> None:
    """Activate joints between the trunk and a foot, shoulders, and those that the user keeps."""
    on_legs = {b for foot in anatomy.feet for b in ancestors(model, foot)}
    frozen = []
    for j in movable:
        walks = model.jnt_bodyid[j] in on_legs or j in anatomy.swinging
        if walks or matches(model.joint(j).name, keep):
            anatomy.active.append(j)
        else:
            frozen.append(model.joint(j).name or f"joint {j}")
    if frozen:
        notes.change(
            f"joints {listed(frozen)} frozen",
            "no leg hangs on them, so they have no part in walking (--keep PATTERN keeps some)",
        )
    if len(anatomy.active) > MOST_JOINTS:
        _freeze_least(model, anatomy, keep, notes)
    if len(anatomy.active) > MOST_JOINTS:
        raise UserError(
            f"{len(anatomy.active)} joints would move; freeze those that do not matter with "
            f"--freeze (at most {MOST_JOINTS})"
        )


def _freeze_least(
    model: mujoco.MjModel, anatomy: Anatomy, keep: Sequence[str], notes: Notes
) -> None:
    """Keep in each leg the joints that swing its end farthest; an insect's toes freeze."""
    data = posed(model, anatomy.qpos)
    kept = set()
    for foot in anatomy.feet:
        chain = ancestors(model, foot)
        leg = [j for j in anatomy.active if int(model.jnt_bodyid[j]) in chain]
        ends = data.xpos[subtree(model, foot)]

        def reach(joint: int, ends: np.ndarray = ends) -> float:
            arms = ends - data.xanchor[joint]
            return float(np.linalg.norm(np.cross(data.xaxis[joint], arms), axis=1).max())

        kept.update(sorted(leg, key=reach, reverse=True)[:ENOUGH])
    kept.update(j for j in anatomy.active if matches(model.joint(j).name, keep))
    frozen = [model.joint(j).name or f"joint {j}" for j in anatomy.active if j not in kept]
    notes.change(
        f"joints {listed(frozen)} frozen",
        f"of {len(anatomy.active)} joints of the legs those that swing a foot least "
        "(--keep PATTERN keeps some)",
    )
    anatomy.active = [j for j in anatomy.active if j in kept]


def _check_loops(model: mujoco.MjModel, anatomy: Anatomy) -> None:
    """Refuse a loop that contains a moving joint."""
    moved = {
        b
        for b in anatomy.bodies
        if any(int(model.jnt_bodyid[j]) in ancestors(model, b) for j in anatomy.active)
    }
    for e in range(model.neq):
        if int(model.eq_type[e]) not in (
            int(mujoco.mjtEq.mjEQ_CONNECT),
            int(mujoco.mjtEq.mjEQ_WELD),
        ):
            continue
        objects = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
        if int(model.eq_objtype[e]) == int(mujoco.mjtObj.mjOBJ_SITE):
            objects = [int(model.site_bodyid[o]) for o in objects]
        if any(o in moved for o in objects):
            a, b = (model.body(max(o, 0)).name for o in objects)
            name = model.equality(e).name or f"equality constraint {e}"
            raise UserError(
                f'"{name}" closes a loop between "{a}" and "{b}", and only trees can be simulated '
                "here; "
                "take one of the two rods out, or the constraint, and import again"
            )
