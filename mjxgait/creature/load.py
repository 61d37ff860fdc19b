"""Load a creature folder: all facts that the other packages need, checked, in one frozen value."""

import dataclasses
import re
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.config.tables import build, parse_toml
from mjxgait.creature import geometry
from mjxgait.creature.anatomy import (
    Corrections,
    Feet,
    Frame,
    Gains,
    Joints,
    Mirror,
)
from mjxgait.creature.creature import (
    FLOOR,
    HINGE,
    ORIGIN,
    SLIDE,
    Creature,
)
from mjxgait.creature.geometry import check_world
from mjxgait.creature.joints import mirrored, stepping_of, swings_of
from mjxgait.creature.settings import CreatureSettings, JointException
from mjxgait.errors import UserError, did_you_mean, matching
from mjxgait.files import read_text
from mjxgait.tasks.walk.gaits import stations_of

NOT_ALONE = re.compile(
    r"<\s*(!DOCTYPE|!ENTITY|include|plugin|extension|replicate|composite|"
    r"flexcomp|attach|model|size)\b|[\s\"'](file\w*|\w+dir)\s*="
)
MODEL, SETTINGS = "creature.xml", "creature.toml"
HEAVIEST = 1e6
"""Limit of a body's mass in kg and of its moments of inertia in kg·m²."""
MOST_TEXT = 8_000_000
"""Largest size of a file in bytes."""


def load_creature(folder: Path) -> Creature:
    """Return the creature in a folder that holds `creature.xml` and `creature.toml`.

    Raises:
      UserError: names the file, the wrong element and the remedy.
    """
    paths = [folder / SETTINGS, folder / MODEL]
    paths += [path for path in [folder / ORIGIN] if path.is_file()]
    files = {path.name: read_text(path, MOST_TEXT) for path in paths}
    return creature_of(files, folder)


def creature_of(files: Mapping[str, str], folder: Path | None = None) -> Creature:
    """Return the creature of these files, by name. folder: that they are from.

    Raises:
      UserError: names the file, the wrong element and the remedy.
    """
    files = {name: files[name] for name in (SETTINGS, MODEL, ORIGIN) if name in files}
    toml, xml = (str(folder / name if folder else name) for name in (SETTINGS, MODEL))
    settings = build(CreatureSettings, parse_toml(files[SETTINGS], toml), toml)
    _check_alone(xml, files[MODEL])
    try:
        model = mujoco.MjModel.from_xml_string(files[MODEL])
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(
            f"{xml}: not a model that MuJoCo can load ({' '.join(str(error).split())})"
        ) from None
    try:
        return _assemble(settings, files, model)
    except UserError as error:
        raise UserError(f"{folder or settings.creature.name}: {error}") from None


def _check_alone(path: str, text: str) -> None:
    """Refuse other files, plugins and replication, because a body may come from a stranger."""
    if found := NOT_ALONE.search(text):
        what = found.group(1) or found.group(2)
        raise UserError(
            f'{path}: "{what}" is not allowed here: the file must hold the whole body; `mjxgait '
            "import` makes such a file"
        )


def _assemble(
    settings: CreatureSettings, files: Mapping[str, str], model: mujoco.MjModel
) -> Creature:
    trunk = _checked_trunk(model, settings)
    data = _standing(model, settings.creature.keyframe)
    axes = _trunk_axes(data.xmat[trunk].reshape(3, 3), np.array(settings.creature.forward))
    found = _actuated(model, trunk, geometry.beside(model, settings.creature.beside))
    names = [model.joint(j).name for j in found]
    values = _joint_values(settings, names)
    partner, sign = mirrored(model, data, settings, found, axes)
    creature = Creature(
        settings=settings,
        files=files,
        model=model,
        trunk=trunk,
        stand_qpos=data.qpos.copy(),
        frame=_frame(model, data, settings, axes, found),
        joints=_joints(
            model, data, found, np.radians(values["range"]), swings_of(settings.swing, names)
        ),
        gains=Gains(values["kp"], values["kd"], values["torque_limit"]),
        mirror=Mirror(sign, tuple(map(int, partner)), settings.mirror.symmetric),
        corrections=_corrections(model, settings, found, names),
        feet=_feet(model, data, settings, trunk, axes),
    )
    _check(creature, data)
    if settings.creature.planar:
        _check_plane(creature, data)
    return creature


def _checked_trunk(model: mujoco.MjModel, settings: CreatureSettings) -> int:
    """Return the trunk's id, once all other names and the model's numbers are checked."""
    own, body = settings.creature, mujoco.mjtObj.mjOBJ_BODY
    trunk = _id(model, body, own.trunk, "creature.trunk")
    if not model.body_jntnum[trunk]:
        raise UserError(
            f'creature.trunk = "{own.trunk}": has no joint, so it cannot move; give it a free '
            "joint, or name the body that has one"
        )
    for key, parts in (("rig.bones", settings.rig.bones), ("rig.turned", settings.rig.turned)):
        for part in parts:
            _id(model, body, part, key)
    _check_numbers(model)
    beside = [_id(model, body, name, "creature.beside") for name in own.beside]
    check_world(model, trunk, _id(model, mujoco.mjtObj.mjOBJ_GEOM, FLOOR, "the floor"), beside)
    return trunk


def _corrections(
    model: mujoco.MjModel, settings: CreatureSettings, joints: list[int], names: list[str]
) -> Corrections:
    """The weights of all corrections. joints: ids of the actuated ones, and their names."""
    steering, balance, stepping = settings.steering, settings.balance, settings.stepping
    return Corrections(
        steer_bend=_weights(steering.bend, names, "steering.bend"),
        steer_stride=_weights(steering.stride, names, "steering.stride"),
        balance_pitch=_weights(balance.pitch, names, "balance.pitch"),
        balance_roll=_weights(balance.roll, names, "balance.roll"),
        stepping=stepping_of(
            model,
            _weights(stepping.ahead, names, "stepping.ahead"),
            _weights(stepping.aside, names, "stepping.aside"),
            _weights(stepping.turn, names, "stepping.turn"),
            joints,
            _foot_bodies(model, settings)[0],
        ),
    )


def _actuated(model: mujoco.MjModel, trunk: int, beside: np.ndarray) -> list[int]:
    """Ids of the actuated joints: all hinges and slides but the trunk's and those of others."""
    joints = [
        j
        for j in range(model.njnt)
        if model.jnt_type[j] in (HINGE, SLIDE)
        and model.jnt_bodyid[j] != trunk
        and not beside[model.jnt_bodyid[j]]
    ]
    if not joints:
        raise UserError("the model has no hinge joint below its trunk, so there is nothing to move")
    return joints


def _joints(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    joints: list[int],
    poses: np.ndarray,
    swings: tuple[tuple[int, int, float], ...],
) -> Joints:
    """The actuated joints.

    poses: [J, 2] rad, range of targets about the standing pose. swings: see `Joints`.
    """
    stand, given = data.qpos[model.jnt_qposadr[joints]], model.jnt_range[joints]
    endless = (given == 0).all(1, keepdims=True)
    low, high = np.where(endless, [-np.inf, np.inf], given).T
    return Joints(
        names=tuple(model.joint(j).name for j in joints),
        qpos=tuple(map(int, model.jnt_qposadr[joints])),
        dofs=tuple(map(int, model.jnt_dofadr[joints])),
        stand=stand,
        pose_low=np.maximum(stand + poses[:, 0], low),
        pose_high=np.minimum(stand + poses[:, 1], high),
        low=low,
        high=high,
        swings=swings,
    )


def _frame(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    settings: CreatureSettings,
    axes: np.ndarray,
    joints: list[int],
) -> Frame:
    trunk = model.body(settings.creature.trunk).id
    rotation = data.xmat[trunk].reshape(3, 3).copy()
    feet, _ = _foot_bodies(model, settings)
    ahead = (rotation @ axes[0]) * [1, 1, 0]
    ahead = ahead / np.linalg.norm(ahead)
    length = settings.creature.body_length
    return Frame(
        forward=axes[0],
        left=axes[1],
        up=axes[2],
        stand_pos=data.xpos[trunk].copy(),
        stand_rot=rotation,
        start_axes=(ahead.astype(np.float32), np.cross([0, 0, 1], ahead).astype(np.float32)),
        hip_height=float(geometry.leg_lengths(model, data, feet, joints).mean()),
        body_length=length or geometry.body_length(model, data, rotation @ axes[0]),
        mass=float(model.body_mass[~geometry.beside(model, settings.creature.beside)].sum()),
    )


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
            f'creature.xml has no keyframe "{keyframe}" for the standing pose; add <keyframe><key '
            f'name="{keyframe}" qpos=.../>'
        )
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    return data


def _trunk_axes(rotation: np.ndarray, forward: np.ndarray) -> np.ndarray:
    """Rows forward, left, up in the trunk's frame.

    Forward is as given; up is as near to the world's as it can be in the standing pose.
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
        for i in matching(exception.match, names, "joint", "creature.toml: joint.match"):
            rows[i].update(
                {
                    k: v
                    for k, v in dataclasses.asdict(exception).items()
                    if v is not None and k != "match"
                }
            )
    fields = {field.name for field in dataclasses.fields(JointException)} - {"match"}
    return {key: np.array([row[key] for row in rows], dtype=float) for key in fields}


def _weights(table: Mapping[str, float], names: list[str], key: str) -> np.ndarray:
    weights = np.zeros(len(names))
    for pattern, weight in table.items():
        weights[matching(pattern, names, "joint", f"creature.toml: {key}")] = weight
    return weights


def _feet(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    settings: CreatureSettings,
    trunk: int,
    axes: np.ndarray,
) -> Feet:
    bodies, stepping = _foot_bodies(model, settings)
    kind = mujoco.mjtObj.mjOBJ_GEOM
    ground = [_id(model, kind, name, "creature.ground") for name in settings.creature.ground]
    nose = data.xmat[trunk].reshape(3, 3) @ axes[0] * [1, 1, 0]
    nose = nose / np.linalg.norm(nose)
    level = np.stack([nose, np.cross([0, 0, 1], nose)], 1)
    foot_of = [bodies.index(_foot_body(model, settings, g)) for g in stepping]
    own = [
        [g for g, foot in zip(stepping, foot_of, strict=True) if foot == n]
        for n in range(len(bodies))
    ]
    places = [(data.geom_xpos[geoms].mean(0) - data.xpos[trunk]) @ level for geoms in own]
    return Feet(
        names=tuple(model.body(b).name for b in bodies),
        foot_of_geoms=tuple(foot_of),
        watched_ids=(*stepping, *_forbidden(model, stepping, ground)),
        ground_ids=tuple(ground),
        stations=stations_of([(float(ahead), float(left)) for ahead, left in places]),
        places=np.array(places),
    )


def _foot_bodies(model: mujoco.MjModel, settings: CreatureSettings) -> tuple[list[int], list[int]]:
    """Foot bodies, and foot geoms in the order of their feet; geoms of one body form one foot."""
    names = settings.creature.feet
    if not names:
        raise UserError("creature.feet is empty; name the geoms that step on the floor")
    if twice := [name for name in names if names.count(name) > 1]:
        raise UserError(f'creature.feet names "{twice[0]}" twice; leave one out')
    geoms = [_id(model, mujoco.mjtObj.mjOBJ_GEOM, name, "creature.feet") for name in names]
    for geom, name in zip(geoms, names, strict=True):
        if model.geom_bodyid[geom] == 0:
            raise UserError(f'creature.feet names "{name}", which belongs to no body; leave it out')
    body_of = {g: _foot_body(model, settings, g) for g in geoms}
    bodies = list(dict.fromkeys(body_of.values()))
    return bodies, sorted(geoms, key=lambda g: bodies.index(body_of[g]))


def _foot_body(model: mujoco.MjModel, settings: CreatureSettings, geom: int) -> int:
    """The body of a geom; in a skeleton, where each bone is a part, the one it is fixed to."""
    body = int(model.geom_bodyid[geom])
    return geometry.moving_body(model, body) if settings.rig.bones else body


def _forbidden(model: mujoco.MjModel, feet: list[int], ground: list[int]) -> list[int]:
    floor = _id(model, mujoco.mjtObj.mjOBJ_GEOM, FLOOR, "the floor")
    colliding = [
        g for g in range(model.ngeom) if model.geom_contype[g] or model.geom_conaffinity[g]
    ]
    return [g for g in colliding if g not in {floor, *feet, *ground} and model.geom_bodyid[g] != 0]


def _check_plane(creature: Creature, data: mujoco.MjData) -> None:
    """Refuse a planar body that can leave its plane."""
    names = creature.joints.names
    axes = data.xaxis[[creature.model.joint(name).id for name in names]]
    for name, alike in zip(names, geometry.parallel(axes), strict=True):
        if not alike:
            raise UserError(
                f'creature.planar: joint "{name}" turns about another axis than "{names[0]}", so '
                "this is no body in a plane; leave `planar` out"
            )


def _check_numbers(model: mujoco.MjModel) -> None:
    """Refuse a time step or masses with which nothing can be simulated; MuJoCo accepts them."""
    if not 0 < (step := model.opt.timestep) < np.inf:
        raise UserError(
            f"creature.xml: option.timestep = {step:g} s; it must be above zero, such as 0.005"
        )
    for body in range(1, model.nbody):
        for what, values in (("mass", model.body_mass), ("inertia", model.body_inertia)):
            if not (np.abs(values[body]) < HEAVIEST).all():
                raise UserError(
                    f'creature.xml: body "{model.body(body).name}" has a {what} of '
                    f"{np.max(values[body]):g}; give it less than {HEAVIEST:g}"
                )


def _check(creature: Creature, data: mujoco.MjData) -> None:
    """Refuse an empty pose range, and gains outside SPD's stable region.

    The region is `h² kp < (4 I + 2 h kd) / 3` (docs/reference/controller.md).
    """
    model, h = creature.model, creature.model.opt.timestep
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    try:
        inertia = 1 / np.diag(np.linalg.inv(mass))[creature.joints.dof_adr]
    except np.linalg.LinAlgError:
        raise UserError(
            "its mass matrix is singular: two joints of one body turn alike; take one out"
        ) from None
    for j, name in enumerate(creature.joints.names):
        if creature.joints.pose_low[j] > creature.joints.pose_high[j]:
            raise UserError(
                f'joint "{name}": its pose range lies outside its range in creature.xml; widen one '
                "of them"
            )
        if h * h * creature.gains.kp[j] >= (4 * inertia[j] + 2 * h * creature.gains.kd[j]) / 3:
            need = (1.5 * h * h * creature.gains.kp[j] - 2 * inertia[j]) / h
            raise UserError(
                f'joint "{name}": kp = {creature.gains.kp[j]:g} is unstable at a time step of '
                f"{h:g} s; raise kd to {need:.3g} or lower kp"
            )
