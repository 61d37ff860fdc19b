"""Checks for models that the lane-major physics can simulate."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

PLANE, SPHERE, CAPSULE = (
    int(t)
    for t in (
        mujoco.mjtGeom.mjGEOM_PLANE,
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
    )
)
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)


class UnsupportedModel(Exception):
    """Error for a model that the lane-major physics does not support; the message says why."""


def check_supported(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Pairs (floor, geom) of geoms that may touch.

    Raises:
      UnsupportedModel: the lane-major physics does not support the model.
    """
    _check_options(model)
    _check_elements(model)
    _check_joints(model)
    return _contact_pairs(model)


def _refuse(when: Any, reason: str, names: Sequence[str] = ()) -> None:
    """Raise if `when` [n] holds anywhere, and list the names of the elements for which it holds."""
    if np.any(when):
        told = [name for name, guilty in zip(names, np.ravel(when), strict=False) if guilty]
        some = ", ".join(told[:3]) + (f" and {len(told) - 3} more" if len(told) > 3 else "")
        raise UnsupportedModel(f"{reason}: {some}" if told else reason)


def _check_options(model: mujoco.MjModel) -> None:
    option, flag = model.opt, mujoco.mjtDisableBit
    off = option.disableflags
    _refuse(option.integrator != mujoco.mjtIntegrator.mjINT_EULER, "the integrator is not Euler")
    _refuse(option.solver != mujoco.mjtSolver.mjSOL_NEWTON, "the solver is not Newton")
    _refuse(option.cone != mujoco.mjtCone.mjCONE_PYRAMIDAL, "the friction cone is not pyramidal")
    _refuse(
        (model.dof_damping != 0) & (not off & flag.mjDSBL_EULERDAMP),
        "joints have damping and eulerdamp is on (disable it: damping is explicit)",
        _dof_names(model),
    )
    _refuse(off & (flag.mjDSBL_SPRING | flag.mjDSBL_DAMPER), "springs or dampers are disabled")
    _refuse(option.noslip_iterations, "noslip iterations")
    _refuse(option.wind, "wind")
    _refuse(
        option.enableflags & ~int(mujoco.mjtEnableBit.mjENBL_ENERGY),
        "an enable flag other than energy",
    )


def _check_elements(model: mujoco.MjModel) -> None:
    for name, count in {
        "actuators (joint torques are applied directly)": model.nu,
        "equality constraints": model.neq,
        "tendons": model.ntendon,
        "explicit contact pairs": model.npair,
        "mocap bodies": model.nmocap,
        "flexible bodies": model.nflex,
        "plugins": model.nplugin,
    }.items():
        _refuse(count, f"the model has {name}")
    _refuse(model.nv == 0, "nothing in the model can move")
    _refuse(model.body_gravcomp, "gravity compensation")
    _refuse(model.geom_fluid, "a geom has a fluid shape (only MuJoCo's inertia boxes are known)")
    for name in ("geom_adhesion", "geom_surfacevel"):
        _refuse(getattr(model, name, 0), f"a geom uses {name}")


def _check_joints(model: mujoco.MjModel) -> None:
    rotates = np.isin(model.jnt_type, (FREE, BALL))
    joints = [model.joint(j).name for j in range(model.njnt)]
    _refuse(model.jnt_limited.astype(bool) & rotates, "a ball joint has a limit", joints)
    _refuse(
        (model.jnt_stiffness.reshape(model.njnt, -1) != 0).any(axis=1) & rotates,
        "a ball or free joint has stiffness",
        joints,
    )
    _refuse(model.dof_frictionloss, "joints have dry friction (frictionloss)", _dof_names(model))
    _refuse(getattr(model, "jnt_stiffnesspoly", 0), "joints have nonlinear stiffness")
    _refuse(getattr(model, "dof_dampingpoly", 0), "joints have nonlinear damping")
    balls = np.nonzero(model.jnt_type == BALL)[0]
    _refuse(
        model.body_jntnum[model.jnt_bodyid[balls]] > 1,
        "a ball joint shares its body with another joint",
        [joints[j] for j in balls],
    )


def _dof_names(model: mujoco.MjModel) -> list[str]:
    """Joint of each degree of freedom."""
    return [model.joint(j).name for j in model.dof_jntid]


def _contact_pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    pairs = []
    for a in range(model.ngeom):
        for b in range(a + 1, model.ngeom):
            if _may_touch(model, a, b):
                pair = (a, b) if model.geom_type[a] == PLANE else (b, a)
                _check_pair(model, *pair)
                pairs.append(pair)
    _refuse(len({floor for floor, _ in pairs}) > 1, "there are several floors")
    return pairs


def _check_pair(model: mujoco.MjModel, floor: int, geom: int) -> None:
    names = " and ".join(model.geom(g).name or f"geom {g}" for g in (floor, geom))
    _refuse(model.geom_type[floor] != PLANE, f"{names} can touch, and neither is a plane")
    _refuse(
        not _is_floor(model, floor),
        f"{names} can touch, and the plane is not the floor z = 0 of the world",
    )
    known = np.isin(model.geom_type[geom], (SPHERE, CAPSULE))
    _refuse(not known, f"{names} can touch: only spheres and capsules may touch the floor")
    condim, priority = model.geom_condim[[floor, geom]], model.geom_priority[[floor, geom]]
    chosen = max(condim) if priority[0] == priority[1] else condim[np.argmax(priority)]
    _refuse(chosen != 3, f"{names} touch with condim other than 3")
    _refuse(model.geom_gap[[floor, geom]], f"{names} touch with a gap")


def _is_floor(model: mujoco.MjModel, plane: int) -> bool:
    level = np.allclose(model.geom_quat[plane], (1, 0, 0, 0)) or np.allclose(
        model.geom_quat[plane][1:3], 0
    )
    return bool(model.geom_bodyid[plane] == 0 and model.geom_pos[plane][2] == 0 and level)


def _may_touch(model: mujoco.MjModel, a: int, b: int) -> bool:
    """MuJoCo's collision filter (computation docs, "Selection")."""
    if not (
        model.geom_contype[a] & model.geom_conaffinity[b]
        or model.geom_contype[b] & model.geom_conaffinity[a]
    ):
        return False
    body_a, body_b = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
    weld_a, weld_b = model.body_weldid[body_a], model.body_weldid[body_b]
    if weld_a == weld_b or (body_a << 16) + body_b in set(model.exclude_signature):
        return False
    if (
        model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
        or weld_a == 0
        or weld_b == 0
    ):
        return True
    parent_a, parent_b = (
        model.body_weldid[model.body_parentid[weld_a]],
        model.body_weldid[model.body_parentid[weld_b]],
    )
    return bool(weld_a != parent_b and weld_b != parent_a)
