"""Loads a creature folder: every fact that the other rooms need, checked, in one frozen value."""

import dataclasses
import fnmatch
import re
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.creature import FLOOR, HINGE, Creature
from mjxgait.creature.settings import CreatureSettings, JointException
from mjxgait.creature.world import check_world
from mjxgait.errors import UserError, did_you_mean
from mjxgait.settings.tables import build, read_toml

SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
NOT_ALONE = re.compile(
    r"<\s*(!DOCTYPE|!ENTITY|include|plugin|extension|replicate|composite|flexcomp|attach|model|size)\b|[\s\"'](file\w*|\w+dir)\s*="
)
MOST_TEXT = 8_000_000
"""Characters of a file."""


def load_creature(folder: Path) -> Creature:
    """The creature in a folder that holds `creature.xml` and `creature.toml`.

    Raises:
      UserError: names the file and the element that is wrong, and the way out.
    """
    toml, xml = folder / "creature.toml", folder / "creature.xml"
    settings = build(CreatureSettings, read_toml(toml), str(toml))
    try:
        files = {path.name: path.read_text(encoding="utf-8") for path in (toml, xml)}
        _check_alone(xml, files["creature.xml"])
        model = mujoco.MjModel.from_xml_string(files["creature.xml"])
    except OSError as error:
        raise UserError(f"{xml}: cannot be read ({error.strerror})") from None
    except (ValueError, UnicodeDecodeError, mujoco.FatalError) as error:
        raise UserError(
            f"{xml}: not a model that MuJoCo can load ({' '.join(str(error).split())})"
        ) from None
    try:
        return _assemble(settings, files, model)
    except UserError as error:
        raise UserError(f"{folder}: {error}") from None


def _check_alone(path: Path, text: str) -> None:
    """A body may come from a stranger: it refers to no other file, runs no plugin, and does not
    multiply itself.
    """
    if len(text) > MOST_TEXT:
        raise UserError(f"{path}: larger than {MOST_TEXT // 1_000_000} MB; a creature is smaller")
    if found := NOT_ALONE.search(text):
        what = found.group(1) or found.group(2)
        raise UserError(
            f'{path}: "{what}" is not allowed here: the file must hold the whole body; `mjxgait '
            "import` makes such a file"
        )


def _assemble(
    settings: CreatureSettings, files: Mapping[str, str], model: mujoco.MjModel
) -> Creature:
    trunk = _id(model, mujoco.mjtObj.mjOBJ_BODY, settings.creature.trunk, "creature.trunk")
    check_world(model, trunk, _id(model, mujoco.mjtObj.mjOBJ_GEOM, FLOOR, "the floor"))
    data = _standing(model, settings.creature.keyframe)
    axes = _trunk_axes(data.xmat[trunk].reshape(3, 3), np.array(settings.creature.forward))
    joints = [
        j
        for j in range(model.njnt)
        if model.jnt_type[j] in (HINGE, SLIDE) and model.jnt_bodyid[j] != trunk
    ]
    if not joints:
        raise UserError("the model has no hinge joint below its trunk, so there is nothing to move")
    names = [model.joint(j).name for j in joints]
    qpos_adr, dof_adr = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    stand = data.qpos[qpos_adr]
    values = _joint_values(settings, names)
    joint_range = np.where(
        (model.jnt_range[joints] == 0).all(1, keepdims=True),
        [-np.inf, np.inf],
        model.jnt_range[joints],
    )
    feet, feet_geoms = _feet(model, settings.creature.feet)
    ground = np.array(
        [
            _id(model, mujoco.mjtObj.mjOBJ_GEOM, g, "creature.ground")
            for g in settings.creature.ground
        ],
        dtype=int,
    )
    partner, sign = _mirror(model, data, settings, joints, names, axes)
    world = data.xmat[trunk].reshape(3, 3) @ axes.T
    creature = Creature(
        settings=settings,
        files=files,
        model=model,
        trunk=trunk,
        forward=axes[0],
        left=axes[1],
        up=axes[2],
        stand_qpos=data.qpos.copy(),
        stand_pos=data.xpos[trunk].copy(),
        stand_rot=data.xmat[trunk].reshape(3, 3).copy(),
        joint_names=tuple(names),
        qpos_adr=qpos_adr,
        dof_adr=dof_adr,
        stand=stand,
        pose_low=np.maximum(stand + np.radians(values["range"][:, 0]), joint_range[:, 0]),
        pose_high=np.minimum(stand + np.radians(values["range"][:, 1]), joint_range[:, 1]),
        joint_low=joint_range[:, 0],
        joint_high=joint_range[:, 1],
        kp=values["kp"],
        kd=values["kd"],
        torque_limit=values["torque_limit"],
        partner=partner,
        sign=sign,
        steer_bend=_weights(settings.steering.bend, names, "steering.bend"),
        steer_stride=_weights(settings.steering.stride, names, "steering.stride"),
        balance_pitch=_weights(settings.balance.pitch, names, "balance.pitch"),
        balance_roll=_weights(settings.balance.roll, names, "balance.roll"),
        watched=np.array([*feet_geoms, *_forbidden(model, feet_geoms, ground)], dtype=int),
        foot_of=np.array([feet.index(model.geom_bodyid[g]) for g in feet_geoms]),
        foot_names=tuple(model.body(b).name for b in feet),
        ground=ground,
        hip_height=float(geometry.leg_lengths(model, data, feet, joints).mean()),
        body_length=settings.creature.body_length or geometry.body_length(model, data, world[:, 0]),
        mass=float(model.body_mass.sum()),
    )
    _check(creature, data)
    return creature


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, key: str) -> int:
    found = mujoco.mj_name2id(model, kind, name)
    if found < 0:
        count = {mujoco.mjtObj.mjOBJ_BODY: model.nbody, mujoco.mjtObj.mjOBJ_GEOM: model.ngeom}[kind]
        known = [n for i in range(count) if (n := mujoco.mj_id2name(model, kind, i))]
        raise UserError(f'{key} = "{name}" is not in creature.xml; {did_you_mean(name, known)}')
    return found


def _standing(model: mujoco.MjModel, keyframe: str) -> mujoco.MjData:
    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, keyframe)
    if key < 0:
        raise UserError(
            f'creature.xml has no keyframe "{keyframe}" for the standing pose; add <keyframe><key name="{keyframe}" qpos=.../>'
        )
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    return data


def _trunk_axes(rotation: np.ndarray, forward: np.ndarray) -> np.ndarray:
    """Rows forward, left, up in the trunk's frame: forward as given, up as near to the world's
    as it can be in the standing pose.
    """
    world_up = rotation.T @ [0.0, 0.0, 1.0]
    up = world_up - forward * (world_up @ forward) / max(forward @ forward, 1e-9)
    if np.linalg.norm(up) < 0.3 or np.linalg.norm(forward) < 1e-6:
        raise UserError(
            f"creature.forward = {forward.tolist()} points up or down in the standing pose; name "
            "the axis the creature walks along"
        )
    up, forward = up / np.linalg.norm(up), forward / np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def _joint_values(settings: CreatureSettings, names: list[str]) -> dict[str, np.ndarray]:
    rows = [dataclasses.asdict(settings.joints) for _ in names]
    for exception in settings.joint:
        for i in _matching(exception.match, names, "joint.match"):
            rows[i].update(
                {
                    k: v
                    for k, v in dataclasses.asdict(exception).items()
                    if v is not None and k != "match"
                }
            )
    fields = {field.name for field in dataclasses.fields(JointException)} - {"match"}
    return {key: np.array([row[key] for row in rows], dtype=float) for key in fields}


def _matching(pattern: str, names: list[str], key: str) -> list[int]:
    found = [i for i, name in enumerate(names) if fnmatch.fnmatchcase(name, pattern)]
    if not found:
        raise UserError(
            f'creature.toml: {key}: no joint matches "{pattern}"; {did_you_mean(pattern, names)}'
        )
    return found


def _weights(table: Mapping[str, float], names: list[str], key: str) -> np.ndarray:
    weights = np.zeros(len(names))
    for pattern, weight in table.items():
        weights[_matching(pattern, names, key)] = weight
    return weights


def _feet(model: mujoco.MjModel, names: tuple[str, ...]) -> tuple[list[int], list[int]]:
    """Foot bodies, and foot geoms in the order of their feet; geoms on one body are one foot."""
    if not names:
        raise UserError("creature.feet is empty; name the geoms that step on the floor")
    geoms = [_id(model, mujoco.mjtObj.mjOBJ_GEOM, name, "creature.feet") for name in names]
    bodies = list(dict.fromkeys(int(model.geom_bodyid[g]) for g in geoms))
    return bodies, sorted(geoms, key=lambda g: bodies.index(int(model.geom_bodyid[g])))


def _forbidden(model: mujoco.MjModel, feet: list[int], ground: np.ndarray) -> list[int]:
    floor = _id(model, mujoco.mjtObj.mjOBJ_GEOM, FLOOR, "the floor")
    colliding = [
        g for g in range(model.ngeom) if model.geom_contype[g] or model.geom_conaffinity[g]
    ]
    return [
        g
        for g in colliding
        if g not in {floor, *feet, *ground.tolist()} and model.geom_bodyid[g] != 0
    ]


def _mirror(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    settings: CreatureSettings,
    joints: list[int],
    names: list[str],
    axes: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Partner [J] and sign [J]: those that the file states, the others from the geometry;
    without symmetry everyone is their own.
    """
    partner, sign = np.arange(len(joints)), np.ones(len(joints), dtype=int)
    if not settings.mirror.symmetric:
        return partner, sign
    for pair in settings.mirror.pairs:
        for name in (pair.joint, pair.partner):
            if name not in names:
                raise UserError(
                    f'mirror.pairs: no joint is called "{name}"; {did_you_mean(name, names)}'
                )
        partner[names.index(pair.joint)], sign[names.index(pair.joint)] = (
            names.index(pair.partner),
            pair.sign,
        )
    stated = {pair.joint for pair in settings.mirror.pairs}
    free = np.array([i for i, name in enumerate(names) if name not in stated], dtype=int)
    if len(free):
        trunk, chosen = model.body(settings.creature.trunk).id, [joints[i] for i in free]
        frame = axes @ data.xmat[trunk].reshape(3, 3).T
        anchors, directions = (
            (data.xanchor[chosen] - data.xpos[trunk]) @ frame.T,
            data.xaxis[chosen] @ frame.T,
        )
        near = 0.02 * float(np.ptp(data.xanchor[joints], axis=0).max() + 0.05)
        found, sign[free] = geometry.mirror_map(
            anchors, directions, model.jnt_type[chosen] == SLIDE, [names[i] for i in free], near
        )
        partner[free] = free[found]
    _check_names(names, partner)
    return partner, sign


def _check_names(names: list[str], partner: np.ndarray) -> None:
    """The geometry and the names must not contradict each other."""
    for name, other in zip(names, (names[p] for p in partner), strict=True):
        swapped = name.replace("left", "\0").replace("right", "left").replace("\0", "right")
        if swapped != name and swapped in names and swapped != other:
            raise UserError(
                f'joint "{name}" mirrors to "{other}" by its geometry but to "{swapped}" by its '
                "name; settle it in [mirror] pairs"
            )


def _check(creature: Creature, data: mujoco.MjData) -> None:
    """Refuses an empty pose range and gains outside SPD's stable region `h² kp < (4 I + 2 h kd)
    / 3` (docs/controller.md).
    """
    model, h = creature.model, creature.model.opt.timestep
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    inertia = 1 / np.diag(np.linalg.inv(mass))[creature.dof_adr]
    for j, name in enumerate(creature.joint_names):
        if creature.pose_low[j] > creature.pose_high[j]:
            raise UserError(
                f'joint "{name}": its pose range lies outside its range in creature.xml; widen one '
                "of them"
            )
        if h * h * creature.kp[j] >= (4 * inertia[j] + 2 * h * creature.kd[j]) / 3:
            need = (1.5 * h * h * creature.kp[j] - 2 * inertia[j]) / h
            raise UserError(
                f'joint "{name}": kp = {creature.kp[j]:g} is unstable at a time step of {h:g} s; '
                f"raise kd to {need:.3g} or lower kp"
            )
