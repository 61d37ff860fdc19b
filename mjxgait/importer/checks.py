"""Check of an import: masses, inertias, places and axes as in the file."""

import mujoco
import numpy as np

from mjxgait.errors import UserError
from mjxgait.importer.anatomy import Anatomy
from mjxgait.importer.body import KinematicModel
from mjxgait.importer.parts import BALL

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
