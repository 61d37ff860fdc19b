"""Other proportions without touching the files: parts made longer, thicker and heavier together."""

import fnmatch
import re
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
import tomli_w

from mjxgait.creature import Creature, load_creature
from mjxgait.creature.geometry import support_extents
from mjxgait.errors import UserError, did_you_mean

MODEL, SETTINGS = "creature.xml", "creature.toml"
SMALLEST, LARGEST = 0.2, 5.0
SIZE = re.compile(r"\n *<size\b[^>]*/>")
"""How much memory MuJoCo wants, which it finds by itself."""


def parse_scales(texts: Sequence[str]) -> dict[str, float]:
    """Factors by pattern of body names, from `PATTERN=FACTOR` each.

    Raises:
      UserError: names the text that is wrong.
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
    """The creature with parts of another size, by pattern of their names; see `scaled_files`."""
    return load_files(scaled_files(creature.files, scales)) if scales else creature


def load_files(files: Mapping[str, str]) -> Creature:
    """The creature whose files these are, by name."""
    with tempfile.TemporaryDirectory() as folder:  # the run folder keeps the creature
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        return load_creature(Path(folder))


def scaled_files(files: Mapping[str, str], scales: Mapping[str, float]) -> dict[str, str]:
    """The files of a creature whose parts are other lengths.

    A part is a body of creature.xml; those that match several patterns are scaled by each. Of a
    part scaled by s the shapes and the places of joints and of the parts that hang on it are times
    s, its mass s³ and its inertia s⁵. The creature stands on its lowest point as before. Gains and
    torque limits stay.

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
        MODEL: SIZE.sub("", spec.to_xml()),
        SETTINGS: _measured(files[SETTINGS], factors),
    }


def _factors(names: Sequence[str], scales: Mapping[str, float]) -> dict[str, float]:
    factors = dict.fromkeys(names, 1.0)
    for pattern, factor in scales.items():
        found = [name for name in names if fnmatch.fnmatchcase(name, pattern)]
        if not found:
            raise UserError(
                f'--scale {pattern}={factor:g}: no part matches "{pattern}"; '
                f"{did_you_mean(pattern, names)}"
            )
        for name in found:
            factors[name] *= factor
    return factors


def _measured(text: str, factors: Mapping[str, float]) -> str:
    """The settings with a body length, where they state one, that follows the trunk's size."""
    table = tomllib.loads(text)
    creature = table["creature"]
    factor = factors.get(creature["trunk"], 1.0)
    if factor == 1.0 or not creature.get("body_length"):
        return text
    return tomli_w.dumps(
        {**table, "creature": {**creature, "body_length": factor * creature["body_length"]}}
    )


def _scale(body: mujoco.MjsBody, s: float) -> None:
    for geom in body.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            raise UserError(
                f'--scale: part "{body.name}" has the mesh "{geom.meshname}", which cannot be '
                "scaled; scale other parts, or import the model with its collision shapes only"
            )
        geom.pos, geom.size, geom.fromto = s * geom.pos, s * geom.size, s * geom.fromto
        # Not a number where a density is given instead, from which MuJoCo reckons itself.
        geom.mass = s**3 * geom.mass
    for part in (*body.joints, *body.sites, *body.bodies):
        part.pos = s * part.pos
    if body.explicitinertial:
        body.ipos, body.mass = s * body.ipos, s**3 * body.mass
        body.inertia, body.fullinertia = s**5 * body.inertia, s**5 * body.fullinertia


def _stand(spec: mujoco.MjSpec, height: float) -> None:
    """Lifts the standing poses, and the pose of the file, until the lowest point is at `height`."""
    model = spec.compile()
    free = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
    lift = height - _lowest(model)
    for key in spec.keys:
        for joint in free:
            qpos = np.array(key.qpos)
            qpos[model.jnt_qposadr[joint] + 2] += lift
            key.qpos = qpos
    for joint in free:
        body = spec.body(model.body(model.jnt_bodyid[joint]).name)
        body.pos = body.pos + np.array([0.0, 0.0, lift])


def _lowest(model: mujoco.MjModel) -> float:
    """m, the lowest point of what can collide, in the first keyframe."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    heights = []
    for geom in range(model.ngeom):
        collides = model.geom_contype[geom] or model.geom_conaffinity[geom]
        if model.geom_bodyid[geom] == 0 or not collides:
            continue
        radius, box, ellipsoid = support_extents(int(model.geom_type[geom]), model.geom_size[geom])
        down = np.abs(data.geom_xmat[geom].reshape(3, 3)[2])
        reach = radius + down @ box + np.linalg.norm(down * ellipsoid)
        heights.append(data.geom_xpos[geom][2] - reach)
    return float(min(heights))
