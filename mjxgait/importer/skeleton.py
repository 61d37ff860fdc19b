"""Conversion of the compiled model and its anatomy to the list of bodies to write."""

import dataclasses
import functools
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.creature.geometry import quaternion, rotation
from mjxgait.importer.anatomy import Anatomy
from mjxgait.importer.notes import Notes, listed, plain_names
from mjxgait.importer.parts import BALL, HINGE, Body, Joint, Shape

MOST_RADIANS = 4 * np.pi
"""Limit in rad beyond which the file's value was meant in degrees."""
SHANK_END = 0.7
"""Share of a shank's length from which on it acts as the foot."""


def build_bodies(
    model: mujoco.MjModel, anatomy: Anatomy, efforts: Mapping[str, float], notes: Notes
) -> list[Body]:
    """Return the creature's bodies, parents first, with frozen joints baked into their places."""
    ids = anatomy.bodies
    names = plain_names([model.body(b).name for b in ids], [f"body_{i}" for i in range(len(ids))])
    xpos, xrot = _placed(model, anatomy)
    bodies = []
    for name, b in zip(names, ids, strict=True):
        parent = ids.index(int(model.body_parentid[b])) if b != anatomy.root else -1
        if parent < 0:
            pos, quat = xpos[b], quaternion(xrot[b])
        elif int(model.jnt_bodyid[anatomy.active].tolist().count(b)):
            pos, quat = model.body_pos[b] * anatomy.scale, model.body_quat[b].copy()
        else:
            above = int(model.body_parentid[b])
            pos, quat = xrot[above].T @ (xpos[b] - xpos[above]), quaternion(xrot[above].T @ xrot[b])
        bodies.append(
            Body(
                name=name,
                id=b,
                parent=parent,
                pos=pos,
                quat=quat,
                mass=float(model.body_mass[b]),
                ipos=model.body_ipos[b] * anatomy.scale,
                iquat=model.body_iquat[b].copy(),
                inertia=model.body_inertia[b] * anatomy.scale**2,
                joints=[],
                shapes=anatomy.shapes[b],
            )
        )
    _add_joints(model, anatomy, bodies, efforts, notes)
    return bodies


def _placed(model: mujoco.MjModel, anatomy: Anatomy) -> tuple[np.ndarray, np.ndarray]:
    """Places of all bodies, active joints at zero and frozen joints where they are kept."""
    data = mujoco.MjData(model)
    data.qpos[:] = anatomy.qpos
    shared = {int(model.jnt_bodyid[j]) for j in anatomy.active}
    for j in range(model.njnt):
        a = int(model.jnt_qposadr[j])
        width = {0: 7, BALL: 4}.get(int(model.jnt_type[j]), 1)
        if int(model.jnt_bodyid[j]) in shared:
            data.qpos[a : a + width] = model.qpos0[a : a + width]
    mujoco.mj_kinematics(model, data)
    turn = anatomy.xrot[anatomy.root] @ data.xmat[anatomy.root].reshape(3, 3).T
    return anatomy.scale * data.xpos @ turn.T, turn @ data.xmat.reshape(-1, 3, 3)


def _add_joints(
    model: mujoco.MjModel,
    anatomy: Anatomy,
    bodies: list[Body],
    efforts: Mapping[str, float],
    notes: Notes,
) -> None:
    at = {body.id: body for body in bodies}
    names = plain_names(
        [model.joint(j).name for j in anatomy.active], [f"joint_{j}" for j in anatomy.active]
    )
    degrees = []
    for name, j in zip(names, anatomy.active, strict=True):
        body = at[int(model.jnt_bodyid[j])]
        pos, armature = (
            model.jnt_pos[j] * anatomy.scale,
            float(model.dof_armature[model.jnt_dofadr[j]]),
        )
        effort = efforts.get(model.joint(j).name, _stated_torque(model, j))
        if int(model.jnt_type[j]) == HINGE:
            low, high = (float(v) for v in model.jnt_range[j])
            low, high = (low, high) if low < high else (-np.inf, np.inf)
            if max(abs(low), abs(high)) > MOST_RADIANS and np.isfinite(low):
                low, high = np.radians(low), np.radians(high)
                degrees.append(name)
            ref = float(model.qpos0[model.jnt_qposadr[j]])
            body.joints.append(
                Joint(name, j, pos, model.jnt_axis[j].copy(), low, high, ref, armature, effort)
            )
            continue
        reach = float(model.jnt_range[j][1]) if model.jnt_limited[j] else np.inf
        for axis, letter in zip(np.eye(3), "xyz", strict=True):
            body.joints.append(
                Joint(f"{name}_{letter}", j, pos, axis, -reach, reach, 0.0, armature, effort)
            )
        notes.change(
            f'ball joint "{name}" written as the three hinges {name}_x, {name}_y and {name}_z',
            "the controller's key poses are angles",
        )
    if degrees:
        notes.change(
            f"limits of {listed(degrees)} read as degrees",
            "they are beyond two turns if they are in radians",
        )


def _stated_torque(model: mujoco.MjModel, joint: int) -> float:
    """Largest torque in N·m stated by the file's actuators or joint; nan if none is."""
    torques = []
    if model.jnt_actfrclimited[joint]:
        torques.append(float(np.abs(model.jnt_actfrcrange[joint]).max()))
    for a in range(model.nu):
        on_joint = (
            int(model.actuator_trntype[a]) == int(mujoco.mjtTrn.mjTRN_JOINT)
            and int(model.actuator_trnid[a][0]) == joint
        )
        if not on_joint:
            continue
        gear = abs(float(model.actuator_gear[a][0]))
        if model.actuator_forcelimited[a]:
            torques.append(gear * float(np.abs(model.actuator_forcerange[a]).max()))
        elif model.actuator_ctrllimited[a] and not model.actuator_biasprm[a].any():
            torques.append(
                gear
                * abs(float(model.actuator_gainprm[a][0]))
                * float(np.abs(model.actuator_ctrlrange[a]).max())
            )
    stated = [t for t in torques if np.isfinite(t) and t > 0]
    return min(stated) if stated else float("nan")


def height_of(bodies: list[Body], xpos: np.ndarray, xrot: np.ndarray, chosen: list[int]) -> float:
    """Lowest point in m of the chosen bodies.

    xpos: [B, 3] places. xrot: [B, 3, 3] rotations, in the list's order.
    """
    lows = [np.inf]
    for i in chosen:
        shapes = [s for s in bodies[i].shapes if s.solid] or [s for s in bodies[i].shapes if s.seen]
        lows += [float((xpos[i, 2] + s.points @ xrot[i, 2]).min() - s.radius) for s in shapes]
    return min(lows)


@dataclasses.dataclass(frozen=True, eq=False)
class Tip:
    """A shape of a foot.

    far: [n] mask of the points at the foot's end; the others belong to the shank. body: its place
    in the list.
    """

    body: int
    shape: Shape
    far: np.ndarray

    @functools.cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Points [n, 3] of the shank and of the foot's end; cached for the search."""
        return self.shape.points[~self.far], self.shape.points[self.far]


def foot_tips(bodies: list[Body], group: list[int]) -> list[Tip]:
    """Shapes that a limb can step on, at the far end of its last moving body and welded bodies."""
    chain, i = [], group[0]
    while i > 0:
        chain.append(float(np.linalg.norm(bodies[i].pos)))
        i = bodies[i].parent
    places = {group[0]: (np.zeros(3), np.eye(3))}
    for i in group[1:]:
        at, turn = places[bodies[i].parent]
        places[i] = (at + turn @ bodies[i].pos, turn @ rotation(bodies[i].quat))
    shapes = [(i, s) for i in group for s in bodies[i].shapes if s.solid] or [
        (i, s) for i in group for s in bodies[i].shapes if s.seen
    ]
    if not shapes:
        return []
    ankle = bodies[group[0]].joints[-1].pos if bodies[group[0]].joints else np.zeros(3)
    clouds = [places[i][0] + s.points @ places[i][1].T - ankle for i, s in shapes]
    cloud = np.concatenate(clouds)
    far = cloud[np.linalg.norm(cloud, axis=1).argmax()]
    reach = float(np.linalg.norm(far))
    # All of a short last part, a foot, may step; only the far end of a long one, a shank.
    share = SHANK_END if reach > 0.25 * (sum(chain) + reach) else -np.inf
    return [Tip(i, s, c @ far > share * reach**2) for (i, s), c in zip(shapes, clouds, strict=True)]


def tip_points(tips: list[Tip], xpos: np.ndarray, xrot: np.ndarray, far: bool = True) -> np.ndarray:
    """Lowest points [n, 3] of the balls of a foot's end, or of its shank."""
    found = []
    for t in tips:
        low = xpos[t.body] + t.ends[far] @ xrot[t.body].T
        low[:, 2] -= t.shape.radius
        found.append(low)
    return np.concatenate(found) if found else np.zeros((0, 3))
