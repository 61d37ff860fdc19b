"""The creature as an editable model (`mujoco.MjSpec`): bodies, joints and shapes from the file.

They are copied from the compiled file. Nothing else of the file, such as its defaults and options,
reaches the physics backends; all of them can simulate what is here.
"""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from mjxgait.creature.creature import REST
from mjxgait.creature.geometry import quaternion
from mjxgait.creature.scale import model_text
from mjxgait.errors import UserError, listed
from mjxgait.importer.anatomy import BALL, HINGE, Anatomy
from mjxgait.importer.notes import Notes, plain_names
from mjxgait.importer.shapes import HIDDEN, copy_geoms, reveal, shapes_of

EMPTY = """
<mujoco>
  <compiler angle="radian" autolimits="false" inertiafromgeom="false"/>
  <option timestep="0.005" integrator="Euler" cone="pyramidal" solver="Newton" iterations="3" ls_iterations="8">
    <flag eulerdamp="disable"/>
  </option>
  <visual>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.45 0.45 0.45" specular="0.05 0.05 0.05"/>
  </visual>
  <default>
    <joint limited="false"/>
    <geom density="0" contype="0" conaffinity="0"/>
    <default class="visual"><geom group="1"/></default>
    <default class="collider"><geom conaffinity="1"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 0.05" contype="1" priority="1" friction="0.9 0.005 0.0001"
          solref="0.01 1" rgba="0.42 0.47 0.42 1"/>
  </worldbody>
</mujoco>
"""
MOST_RADIANS = 4 * np.pi
"""Limit in rad beyond which the file's value was meant in degrees."""


def copy_bodies(model: mujoco.MjModel, ids: list[int], scale: float) -> mujoco.MjSpec:
    """Copy the bodies `ids`, parents first, with masses and shapes, without joints.

    scale: m per unit of length.
    """
    spec = mujoco.MjSpec.from_string(EMPTY)
    names = plain_names([model.body(b).name for b in ids], [f"body_{i}" for i in range(len(ids))])
    made: dict[int, mujoco.MjsBody] = {}
    for name, b in zip(names, ids, strict=True):
        parent = made.get(int(model.body_parentid[b]), spec.worldbody)
        body = made[b] = parent.add_body(
            name=name, pos=scale * model.body_pos[b], quat=model.body_quat[b]
        )
        if model.body_mass[b] > 0:
            body.explicitinertial = True
            body.mass = float(model.body_mass[b])
            body.inertia = scale**2 * model.body_inertia[b]
            body.ipos, body.iquat = scale * model.body_ipos[b], model.body_iquat[b]
        copy_geoms(spec, body, model, b, scale)
        reveal(shapes_of(spec, body, 0))
    return spec


def place_bodies(model: mujoco.MjModel, anatomy: Anatomy) -> None:
    """Place the trunk as in the anatomy's pose, and keep frozen joints as they are in it."""
    data = mujoco.MjData(model)
    data.qpos[:] = anatomy.qpos
    moving = {int(model.jnt_bodyid[j]) for j in anatomy.active}
    for j in range(model.njnt):
        if int(model.jnt_bodyid[j]) in moving:
            a, width = int(model.jnt_qposadr[j]), 4 if int(model.jnt_type[j]) == BALL else 1
            data.qpos[a : a + width] = model.qpos0[a : a + width]
    mujoco.mj_kinematics(model, data)
    xrot = data.xmat.reshape(-1, 3, 3)
    turn = anatomy.turn(data)
    for body, b in zip(anatomy.spec.bodies[1:], anatomy.bodies, strict=True):
        above = int(model.body_parentid[b])
        if b == anatomy.root:
            body.pos = anatomy.scale * turn @ data.xpos[b]
            body.quat = quaternion(turn @ xrot[b])
        elif b not in moving:
            body.pos = anatomy.scale * xrot[above].T @ (data.xpos[b] - data.xpos[above])
            body.quat = quaternion(xrot[above].T @ xrot[b])


def add_joints(
    model: mujoco.MjModel, anatomy: Anatomy, efforts: Mapping[str, float], notes: Notes
) -> tuple[list[int], np.ndarray]:
    """Add the free joint and the active joints; ball joints become three hinges.

    Args:
      efforts: N·m by joint name, as stated outside of MuJoCo's elements.

    Returns:
      source [J] joint id in the file. effort [J] N·m, nan where the file states none.
    """
    spec, scale = anatomy.spec, anatomy.scale
    spec.bodies[1].add_freejoint(name="root")
    bodies = dict(zip(anatomy.bodies, spec.bodies[1:], strict=True))
    names = _joint_names(model, anatomy.active)
    source, effort, degrees = [], [], []
    for j in anatomy.active:
        pos, armature = scale * model.jnt_pos[j], float(model.dof_armature[model.jnt_dofadr[j]])
        low, high = model.jnt_range[j] if model.jnt_range[j][0] < model.jnt_range[j][1] else (0, 0)
        own = names[j]
        ref, axes = float(model.qpos0[model.jnt_qposadr[j]]), [model.jnt_axis[j]]
        if int(model.jnt_type[j]) != HINGE:
            reach = model.jnt_range[j][1] if model.jnt_limited[j] else 0.0
            low, high, ref = -reach, reach, 0.0
            axes = [*np.eye(3)]
            notes.change(
                f'ball joint "{model.joint(j).name}" written as the three hinges {own[0]}, '
                f"{own[1]} and {own[2]}",
                "the controller's key poses are angles",
            )
        elif max(abs(low), abs(high)) > MOST_RADIANS:
            low, high = np.radians(low), np.radians(high)
            degrees.append(own[0])
        for name, axis in zip(own, axes, strict=True):
            bodies[int(model.jnt_bodyid[j])].add_joint(
                name=name, pos=pos, axis=axis, range=(low, high), ref=ref, armature=armature
            )
            source.append(j)
            effort.append(efforts.get(model.joint(j).name, _stated_torque(model, j)))
    if degrees:
        notes.change(
            f"limits of {listed(degrees)} read as degrees",
            "they are beyond two turns if they are in radians",
        )
    return source, np.array(effort)


def _joint_names(model: mujoco.MjModel, joints: Sequence[int]) -> dict[int, list[str]]:
    """Return the names of the hinges of each joint in the file: one, or three of a ball joint."""
    hinges = [
        (j, end)
        for j in joints
        for end in (("",) if int(model.jnt_type[j]) == HINGE else ("_x", "_y", "_z"))
    ]
    wanted = [f"{model.joint(j).name or f'joint_{j}'}{end}" for j, end in hinges]
    fallback = [f"joint_{j}{end}" for j, end in hinges]
    # The free joint is called root.
    unique = plain_names(["root", *wanted], ["root", *fallback])[1:]
    found: dict[int, list[str]] = {}
    for (j, _), name in zip(hinges, unique, strict=True):
        found.setdefault(j, []).append(name)
    return found


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


def tidy(spec: mujoco.MjSpec) -> None:
    """Name the shapes that touch the floor, and remove those that neither touch nor show."""
    for body in spec.bodies[1:]:
        unnamed = [geom for geom in body.geoms if geom.conaffinity and not geom.name]
        for i, geom in enumerate(unnamed):
            geom.name = f"{body.name}_guard" + (f"_{i + 1}" if len(unnamed) > 1 else "")
        for geom in list(body.geoms):
            geom.classname = spec.find_default("collider" if geom.conaffinity else "visual")
            if not geom.conaffinity and geom.group >= HIDDEN:
                spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in [mesh for mesh in spec.meshes if mesh.name not in used]:
        spec.delete(mesh)


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a copy of the editable model; MuJoCo cannot compile meshes twice.

    Raises:
      UserError: the file's numbers do not fit together, such as an axis of no length.
    """
    try:
        return spec.copy().compile()
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(
            "the repaired model does not compile; correct this in the file: "
            f"{' '.join(str(error).split())[:300]}"
        ) from None


def creature_xml(
    spec: mujoco.MjSpec, name: str, stand: np.ndarray, rest: np.ndarray | None = None
) -> str:
    """Return the text of creature.xml. stand, rest: [nq] keyframes of these names, or None.

    Raises:
      UserError: it would not compile.
    """
    spec = spec.copy()
    spec.modelname = name
    spec.add_key(name="stand", qpos=stand)
    if rest is not None:
        spec.add_key(name=REST, qpos=rest)
    for mesh in spec.meshes:  # four digits of a hull are enough to draw it
        mesh.uservert = [float(f"{v:.4g}") for v in mesh.uservert]
    text = model_text(spec)
    compiled(mujoco.MjSpec.from_string(text))
    return text
