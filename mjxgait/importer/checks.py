"""Checks of an import: dropped elements; masses, inertias, places and axes as in the file."""

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.errors import UserError
from mjxgait.importer.anatomy import Anatomy
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.parts import BALL, HINGE, Notes, listed


def tell_dropped(model: mujoco.MjModel, notes: Notes) -> None:
    """Report the file's mechanisms that do not act on the creature."""
    for count, what, why in (
        (model.nu, "actuators", "joint torques are applied directly; their limits were read"),
        (model.ntendon, "tendons", "joint torques are applied directly"),
        (
            int((model.jnt_stiffness != 0).sum() + (model.dof_damping != 0).sum()),
            "springs and dampers",
            "the controller has its own",
        ),
        (
            int((model.dof_frictionloss != 0).sum()),
            "dry joint frictions",
            "the fast physics has none",
        ),
        (
            model.npair + model.nexclude,
            "contact pairs and exclusions",
            "shapes touch the floor only, not each other",
        ),
    ):
        if count:
            notes.change(f"{count} {what} dropped", why)
    notes.change(
        "the floor and all options replaced",
        "a flat floor; time step 5 ms, Newton solver, pyramidal friction: what every physics here "
        "can do",
    )


def tell_left_out(model: mujoco.MjModel, anatomy: Anatomy, notes: Notes) -> None:
    """Report the other contents of the file's world: other bodies, geoms that can be touched."""
    own = {*anatomy.bodies, *geometry.ancestors(model, anatomy.root)}
    others = [b for b in range(1, model.nbody) if b not in own and model.body_parentid[b] == 0]
    touchable = (model.geom_contype | model.geom_conaffinity) != 0
    things = [
        g
        for g in np.flatnonzero(touchable & (model.geom_bodyid == 0))
        if int(model.geom_type[g]) != mujoco.mjtGeom.mjGEOM_PLANE
    ]
    names = [f'body "{model.body(b).name}" ({_content(model, b)})' for b in others]
    names += [f'geom "{model.geom(g).name or g}"' for g in things]
    if names:
        notes.change(f"left out: {listed(names)}", "a walk is evolved on a flat floor, alone")


def _content(model: mujoco.MjModel, top: int) -> str:
    """Mass and hinges of the tree below a body, in words."""
    inside = [b for b in range(1, model.nbody) if top in geometry.ancestors(model, b)]
    hinges = int(np.isin(model.jnt_bodyid[model.jnt_type == HINGE], inside).sum())
    mass = f"{model.body_subtreemass[top]:.3g} kg"
    return f"{mass}, {hinges} joints: a creature of its own" if hinges > 1 else mass


TOLERANCE = 1e-6


def check_same(
    model: mujoco.MjModel, anatomy: Anatomy, puppet: KinematicModel, made: mujoco.MjModel
) -> None:
    """Compare the compiled file with the written creature, body by body and joint by joint.

    Differences are relative to the size.

    Raises:
      UserError: something differs, which is a mistake of the import.
    """
    scale = anatomy.scale
    ids = np.array([body.id for body in puppet.bodies])
    _equal("mass", model.body_mass[ids], made.body_mass[1:], float(model.body_mass[ids].sum()))
    _equal(
        "inertia",
        model.body_inertia[ids] * scale**2,
        made.body_inertia[1:],
        float(model.body_inertia[ids].max()) * scale**2,
    )
    heavy = model.body_mass[ids] > 0
    _equal("centre of mass", (model.body_ipos[ids] * scale)[heavy], made.body_ipos[1:][heavy], 1.0)
    turned = np.abs((model.body_iquat[ids] * made.body_iquat[1:]).sum(1))[heavy]
    _equal("inertia frame", turned, np.ones(len(turned)), 1.0)
    joints = [joint for joint in puppet.joints if int(model.jnt_type[joint.id]) != BALL]
    own = [made.joint(joint.name).id for joint in joints]
    source = [joint.id for joint in joints]
    _equal("joint position", model.jnt_pos[source] * scale, made.jnt_pos[own], 1.0)
    _equal("joint axis", model.jnt_axis[source], made.jnt_axis[own], 1.0)
    _places(model, anatomy, puppet, made, source, own)


def _places(
    model: mujoco.MjModel,
    anatomy: Anatomy,
    puppet: KinematicModel,
    made: mujoco.MjModel,
    source: list[int],
    own: list[int],
) -> None:
    """Compare joint places and axes relative to the trunk, in the file's pose."""
    before, after = mujoco.MjData(model), mujoco.MjData(made)
    before.qpos[:] = anatomy.qpos
    after.qpos[:] = made.qpos0
    for a, b in zip(source, own, strict=True):
        after.qpos[made.jnt_qposadr[b]] = before.qpos[model.jnt_qposadr[a]]
    balls = [
        int(model.jnt_bodyid[j.id]) for j in puppet.joints if int(model.jnt_type[j.id]) == BALL
    ]
    if balls:  # the three hinges of a ball joint stay at zero here
        return
    for m, d in ((model, before), (made, after)):
        mujoco.mj_kinematics(m, d)
    one, other = before.xmat[anatomy.root].reshape(3, 3), after.xmat[1].reshape(3, 3)
    here = (before.xanchor[source] - before.xpos[anatomy.root]) @ one * anatomy.scale
    there = (after.xanchor[own] - after.xpos[1]) @ other
    size = max(float(np.abs(here).max(initial=0)), 1e-3)
    _equal("place of a joint", here, there, size)
    _equal("direction of a joint", before.xaxis[source] @ one, after.xaxis[own] @ other, 1.0)


def _equal(what: str, before: np.ndarray, after: np.ndarray, size: float) -> None:
    worst = float(np.abs(before - after).max(initial=0.0))
    if not worst <= TOLERANCE * max(size, 1e-9):
        raise UserError(
            f"the import changed a {what} by {worst:.2g} of {size:.2g}; this is a mistake of the "
            "import, please report the model"
        )
