"""A creature with other proportions, another time step, or another heading.

A walk backwards is evolved and examined as a walk forward of the body turned around.
"""

import dataclasses
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Literal, get_args

import mujoco
import numpy as np
import tomli_w

from mjxgait.config.tables import dump_toml, merge
from mjxgait.creature.creature import Creature, vertical_freedom
from mjxgait.creature.geometry import lowest
from mjxgait.creature.load import MODEL, SETTINGS, creature_of
from mjxgait.creature.settings import Balance, CreatureSettings, Steering, Stepping, Usual
from mjxgait.errors import UserError, did_you_mean, matching

SMALLEST, LARGEST = 0.2, 5.0
SIZE = re.compile(r"\n *<size\b[^>]*/>")
"""MuJoCo's memory size, removed because MuJoCo finds it by itself."""
ROUNDING = 1e-5
"""Largest relative change of a sum of numbers that are written with six digits."""


def parse_scales(texts: Sequence[str]) -> dict[str, float]:
    """Factors by pattern of body names, from texts `PATTERN=FACTOR`.

    Raises:
      UserError: names the wrong text.
    """
    scales = {}
    for text in texts:
        pattern, equals, number = text.rpartition("=")
        try:
            factor = float(number)
        except ValueError:
            factor = np.nan
        if not (equals and pattern and SMALLEST <= factor <= LARGEST):
            raise UserError(
                f"--scale {text}: give PATTERN=FACTOR, such as '*_shin=1.2', with a factor from "
                f"{SMALLEST} to {LARGEST}"
            )
        scales[pattern] = factor
    return scales


def scaled(creature: Creature, scales: Mapping[str, float]) -> Creature:
    """Return the creature with scaled parts, by pattern of their names; see `scaled_files`."""
    return creature_of(scaled_files(creature.files, scales)) if scales else creature


def model_text(spec: mujoco.MjSpec) -> str:
    """Return the text of creature.xml; MuJoCo writes numbers with six digits.

    The largest moment of a flat or thin body is that of its two others together. It is lowered
    where rounding would make it larger, because MuJoCo does not read that.
    """
    for body in spec.bodies:
        moments = np.array([float(f"{moment:.6g}") for moment in body.inertia])
        if body.explicitinertial and 2 * moments.max() > moments.sum():
            largest = np.arange(3) == moments.argmax()
            body.inertia = np.where(largest, 1 - ROUNDING, 1.0) * body.inertia
    return SIZE.sub("", spec.to_xml())


def scaled_files(
    files: Mapping[str, str], scales: Mapping[str, float], body_length: float | None = None
) -> dict[str, str]:
    """Return the files of a creature with scaled parts.

    A part is a body of creature.xml; a part that matches several patterns is scaled by each.
    Scaling by s multiplies a part's shapes and the places of its joints and children by s, its mass
    by s³ and its inertia by s⁵. The creature stands on its lowest point as before. Gains and torque
    limits stay.

    Args:
      body_length: m, written to the settings; by default a stated one follows the trunk's factor.

    Raises:
      UserError: a pattern matches nothing, or a part has a mesh.
    """
    spec = mujoco.MjSpec.from_string(files[MODEL])
    before = _lowest(spec.compile())
    factors = _factors([body.name for body in spec.bodies if body.name != "world"], scales)
    for body in spec.bodies:
        if (factor := factors.get(body.name, 1.0)) != 1.0:
            _scale(body, factor)
    _stand(spec, before)
    return {
        **files,
        MODEL: model_text(spec),
        SETTINGS: _measured(files[SETTINGS], factors, body_length),
    }


def _factors(names: Sequence[str], scales: Mapping[str, float]) -> dict[str, float]:
    factors = dict.fromkeys(names, 1.0)
    for pattern, factor in scales.items():
        for i in matching(pattern, names, "part", f"--scale {pattern}={factor:g}"):
            factors[names[i]] *= factor
    return factors


def _measured(text: str, factors: Mapping[str, float], body_length: float | None) -> str:
    """The settings with the given body length, or with the stated one times the trunk's factor."""
    table = tomllib.loads(text)
    creature = table["creature"]
    stated, factor = creature.get("body_length"), factors.get(creature["trunk"], 1.0)
    length = body_length or (factor * stated if stated else None)
    if length == stated:
        return text
    return tomli_w.dumps({**table, "creature": {**creature, "body_length": length}})


def _scale(body: mujoco.MjsBody, s: float) -> None:
    for geom in body.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            raise UserError(
                f'part "{body.name}" has the mesh "{geom.meshname}", which cannot be '
                "scaled; scale other parts, or import the model with its collision shapes only"
            )
        geom.pos, geom.size, geom.fromto = s * geom.pos, s * geom.size, s * geom.fromto
        # NaN where a density is given instead, from which MuJoCo computes the mass.
        geom.mass = s**3 * geom.mass
    for part in (*body.joints, *body.sites, *body.bodies):
        part.pos = s * part.pos
    if body.explicitinertial:
        body.ipos, body.mass = s * body.ipos, s**3 * body.mass
        body.inertia, body.fullinertia = s**5 * body.inertia, s**5 * body.fullinertia


def _stand(spec: mujoco.MjSpec, height: float) -> None:
    """Lift the keyframes and the file's own pose until the lowest point is at `height`."""
    model = spec.compile()
    lift = height - _lowest(model)
    upwards = vertical_freedom(model)
    for number, key in enumerate(spec.keys):
        # MuJoCo leaves out of a file what is as in the zero pose.
        key.qpos = model.key_qpos[number] + lift * upwards
    for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        body = spec.body(model.body(model.jnt_bodyid[joint]).name)
        body.pos = body.pos + np.array([0.0, 0.0, lift])


def _lowest(model: mujoco.MjModel) -> float:
    """Height of the lowest point in the first keyframe; m."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    return lowest(model, data)


def at_step(creature: Creature, step: float) -> Creature:
    """Return the creature with a time step in s; 0 keeps its own."""
    if step in (0.0, float(creature.model.opt.timestep)):
        return creature
    spec = mujoco.MjSpec.from_string(creature.files[MODEL])
    spec.option.timestep = step
    return creature_of({**creature.files, MODEL: model_text(spec)})


Way = Literal["forward", "back", "left", "right"]
WAYS: tuple[Way, ...] = get_args(Way)
UNUSUAL = {"task": {"walk": {"fitness": {"leniency": 1.0}}}}
"""Settings of a walk another way: its first steps are short and in bad style, so a crab that had
to go sideways stood.
"""
Table = Mapping[str, float]


def facing(creature: Creature, way: str) -> Creature:
    """Return the creature with its forward axis turned to `way`.

    Its reflexes act on the body as before, under other names. Sideways there is no mirror, because
    the mirror image of a sidestep goes the other way, and no steering, because the correction that
    turns a walk does not turn a sidestep.

    Raises:
      UserError: there is no such way.
    """
    if way not in WAYS:
        raise UserError(f"--way {way}: {did_you_mean(way, WAYS)}")
    if way == "forward":
        return creature
    ahead = {"back": -creature.frame.forward, "left": creature.frame.left}
    axis = ahead.get(way, -creature.frame.left)
    settings = _turned(creature.settings, way, axis)
    return creature_of({**creature.files, SETTINGS: dump_toml(settings)})


def _turned(settings: CreatureSettings, way: str, axis: np.ndarray) -> CreatureSettings:
    # The defaults apply to walking forward; they may not fit another way.
    settings = dataclasses.replace(settings, usual=Usual(), train=merge(settings.train, UNUSUAL))
    balance, stepping, steering = settings.balance, settings.stepping, settings.steering
    x, y, z = np.round(axis, 9) + 0.0
    identity = dataclasses.replace(
        settings.creature,
        name=f"{settings.creature.name}_{way}",
        forward=(float(x), float(y), float(z)),
    )
    if way == "back":
        steering = Steering(_times(steering.bend, -1), _times(steering.stride, -1))
        balance = Balance(_times(balance.pitch, -1), _times(balance.roll, -1))
        stepping = Stepping(_times(stepping.ahead, -1), _times(stepping.aside, -1), stepping.turn)
        return dataclasses.replace(
            settings, creature=identity, steering=steering, balance=balance, stepping=stepping
        )
    # The body is now as long as it was wide, so the stated length is dropped. Roll to the right
    # becomes pitch towards the right side, and likewise all around.
    sign = 1 if way == "right" else -1
    return dataclasses.replace(
        settings,
        creature=dataclasses.replace(identity, body_length=None),
        mirror=dataclasses.replace(settings.mirror, symmetric=False, pairs=()),
        steering=Steering(),
        balance=Balance(_times(balance.roll, sign), _times(balance.pitch, -sign)),
        stepping=Stepping(
            _times(stepping.aside, -sign), _times(stepping.ahead, sign), stepping.turn
        ),
    )


def _times(table: Table, sign: int) -> dict[str, float]:
    return {pattern: sign * weight for pattern, weight in table.items()}
