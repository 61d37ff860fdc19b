"""Model reduced to what its steps need; the physics stays the same."""

from typing import Any

import mujoco
import numpy as np

from mjxgait.creature import Creature
from mjxgait.creature.creature import FLOOR


def bare_model(creature: Creature) -> tuple[mujoco.MjModel, np.ndarray]:
    """Return the evolution model without purely visual shapes, its contacts as explicit pairs.

    Pairs save MuJoCo the search for possible contacts. A model that cannot be reduced is returned
    unchanged. Also returns the ids [G] of the watched geoms in the model.
    """
    full = creature.evolution_model
    names = [full.geom(g).name for g in range(full.ngeom)]
    if "" in names or not _only_the_floor_is_touched(full):
        return full, creature.feet.watched
    spec = mujoco.MjSpec.from_string(creature.files["creature.xml"])
    for body in spec.bodies[1:]:
        _keep_inertia(body, full)
    contacts = _contacts(full)
    kept = {FLOOR, *(names[g] for g in creature.feet.watched), *(names[g] for g in contacts)}
    for geom in list(spec.geoms):
        if geom.name in kept:
            geom.contype = geom.conaffinity = 0
        else:
            spec.delete(geom)
    for geom, mixed in contacts.items():
        spec.add_pair(geomname1=FLOOR, geomname2=names[geom], **mixed)
    bare = spec.compile()
    return bare, np.array([bare.geom(names[g]).id for g in creature.feet.watched], int)


def _only_the_floor_is_touched(full: mujoco.MjModel) -> bool:
    moving, solid = full.geom_bodyid != 0, (full.geom_contype | full.geom_conaffinity) != 0
    each_other = full.geom_contype[moving, None] & full.geom_conaffinity[moving]
    alone = np.flatnonzero(solid & ~moving).tolist() == [full.geom(FLOOR).id]
    return alone and not np.any(each_other)


def _keep_inertia(body: mujoco.MjsBody, full: mujoco.MjModel) -> None:
    """Set a body's inertia explicitly, since some of the shapes that define it are deleted."""
    i = full.body(body.name).id
    body.explicitinertial, body.fullinertia = True, [np.nan] * 6
    body.mass, body.inertia = full.body_mass[i], full.body_inertia[i]
    body.ipos, body.iquat = full.body_ipos[i], full.body_iquat[i]


def _contacts(full: mujoco.MjModel) -> dict[int, dict[str, Any]]:
    """Return each geom's contact with the floor, as MuJoCo mixes it.

    The contacts are found by sinking the body into the floor.
    """
    data = mujoco.MjData(full)
    data.qpos[int(full.jnt_qposadr[full.jnt_type == mujoco.mjtJoint.mjJNT_FREE][0]) + 2] -= 100.0
    mujoco.mj_forward(full, data)
    return {
        int(max(contact.geom)): {
            "condim": contact.dim,
            "friction": contact.friction.copy(),
            "solref": contact.solref.copy(),
            "solimp": contact.solimp.copy(),
            "margin": contact.includemargin,
        }
        for contact in data.contact
    }
