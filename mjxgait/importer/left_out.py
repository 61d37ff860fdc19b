"""Reports of the elements of a model file that an import drops."""

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.importer.anatomy import Anatomy
from mjxgait.importer.notes import Notes, listed
from mjxgait.importer.parts import HINGE


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
