"""Export of a grown body to a creature's files, with a MuJoCo model of true blocks and hinges."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
import tomli_w

from mjxgait.controllers.sims_brain.reference_body import (
    CONTACT_TIME_CONSTANT,
    CUBE,
    CUBE_DENSITY,
    DAMPING,
    DENSITY,
    DISTANCE,
    HALF_A_TURN,
    ROTOR,
    THEIRS,
    Part,
    reach,
)
from mjxgait.creature.geometry import lowest
from mjxgait.errors import UserError

SPIN, ROLL = 0.005, 0.0001
"""MuJoCo's default torsional and rolling friction, unused by contacts of three dimensions."""


CUBE_NAME = "cube"


def body_xml(
    parts: Sequence[Part],
    step: float,
    gravity: float,
    friction: float | None,
    height: float = 1.0,
    keyframe: str = "",
    opponent: Sequence[Part] = (),
) -> str:
    """Return the model's text; parts are `part0` (the root), …, their hinges `part1_0`, ….

    step: s. gravity: m/s². friction: of a floor at z = 0; None for a floor without contacts.
    height: m, of the root's middle. keyframe: name of one with all angles at 0. opponent: parts of
    another body that faces this one, with a cube between them.
    """
    root = ET.Element("mujoco", model="blocks")
    ET.SubElement(root, "compiler", angle="radian")
    down = in_xml((0, 0, -gravity))
    option = ET.SubElement(root, "option", timestep=f"{step:g}", gravity=down)
    ET.SubElement(option, "flag", eulerdamp="disable")
    world = ET.SubElement(root, "worldbody")
    sticking = {}
    if friction is not None:
        hard = {"solref": in_xml((CONTACT_TIME_CONSTANT * step, 1.0))}
        sticking = {"friction": in_xml((friction, SPIN, ROLL)), **hard}
    touched = "0" if friction is None else "1"
    plane = {"type": "plane", "size": "0 0 1", "contype": "0", "conaffinity": touched}
    ET.SubElement(world, "geom", {"name": "floor", **plane, **sticking})
    start = (0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0)
    standing = _with_body(world, parts, start, sticking, "")
    if opponent:
        middle = reach(parts) + DISTANCE + CUBE / 2
        far = middle + CUBE / 2 + DISTANCE + reach(opponent)
        facing = (far, 0.0, resting_height(opponent), *HALF_A_TURN)
        standing += _with_body(world, opponent, facing, sticking, THEIRS)
        standing += _with_cube(world, middle, sticking)
    if keyframe:
        place = in_xml(standing)
        ET.SubElement(ET.SubElement(root, "keyframe"), "key", name=keyframe, qpos=place)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def _with_body(
    world: ET.Element,
    parts: Sequence[Part],
    start: tuple[float, ...],
    sticking: dict[str, str],
    prefix: str,
) -> tuple[float, ...]:
    """Add a body; return its positions with all angles at 0. start: [7] of its root."""
    bodies: list[ET.Element] = []
    for number, part in enumerate(parts):
        name = f"{prefix}part{number}"
        if part.parent < 0:
            at = {"pos": in_xml(start[:3]), "quat": in_xml(start[3:])}
            own = ET.SubElement(world, "body", {"name": name, **at})
            ET.SubElement(own, "freejoint", name=f"{prefix}root")
        else:
            at = {"pos": in_xml(part.place), "quat": in_xml(_quaternion(part.axes))}
            own = ET.SubElement(bodies[part.parent], "body", {"name": name, **at})
        _with_joints_and_block(own, number, part, sticking, prefix)
        bodies.append(own)
    return (*start, *[0.0] * sum(len(part.hinges) for part in parts))


def _with_cube(world: ET.Element, ahead: float, sticking: dict[str, str]) -> tuple[float, ...]:
    """Add the cube on the floor; return its position."""
    half = CUBE / 2
    own = ET.SubElement(world, "body", name=CUBE_NAME, pos=in_xml((ahead, 0, half)))
    ET.SubElement(own, "freejoint", name=CUBE_NAME)
    shape = {"name": CUBE_NAME, "type": "box", "size": in_xml((half, half, half))}
    solid = {"density": f"{CUBE_DENSITY:g}", "contype": "1", "conaffinity": "1"}
    ET.SubElement(own, "geom", {**shape, **solid, **sticking})
    return ahead, 0.0, half, 1.0, 0.0, 0.0, 0.0


def _with_joints_and_block(
    own: ET.Element, number: int, part: Part, sticking: dict[str, str], prefix: str
) -> None:
    damping = DAMPING * part.strength
    for hinge, (axis, swing) in enumerate(zip(part.hinges, part.swing, strict=True)):
        ET.SubElement(
            own,
            "joint",
            name=f"{prefix}part{number}_{hinge}",
            axis=in_xml(np.eye(3)[axis]),
            limited="true",
            range=in_xml((-swing, swing)),
            armature=in_xml((ROTOR * damping,)),
            damping=in_xml((damping,)),
        )
    block = {
        "name": f"{prefix}block{number}",
        "type": "box",
        "size": in_xml(part.half),
        "pos": in_xml(part.middle),
        "density": f"{DENSITY:g}",
        "contype": "1",
        "conaffinity": "1",
    }
    ET.SubElement(own, "geom", {**block, **sticking})


def _quaternion(axes: np.ndarray) -> np.ndarray:
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(axes, float).reshape(9))
    return found


def in_xml(values: Iterable[float]) -> str:
    """Return numbers as an attribute of MuJoCo's XML."""
    return " ".join(f"{float(value):.9g}" for value in values)


SOFT = 0.01
"""1/rad: kp of a hinge over its strength. A brain sends torques, so nothing tracks a pose."""


def body_files(
    parts: Sequence[Part],
    name: str,
    step: float,
    gravity: float,
    friction: float | None,
    around: str,
    opponent: Sequence[Part] = (),
) -> dict[str, str]:
    """Return `creature.xml` and `creature.toml`. around: its medium, for the description.

    opponent: parts of the body that it meets, with a cube between them.

    Raises:
      UserError: the body has no hinge.
    """
    joints = [
        (f"part{number}_{hinge}", part.strength)
        for number, part in enumerate(parts)
        for hinge in range(len(part.hinges))
    ]
    if not joints:
        raise UserError(f"{name}: the body that grew has no hinge, so nothing of it moves")
    height = resting_height(parts)
    beside = {"beside": [f"{THEIRS}part0", CUBE_NAME]} if opponent else {}
    document = {
        "creature": {
            **beside,
            "name": name,
            "description": f"{len(parts)} blocks that evolved to move {around}",
            "trunk": "part0",
            "forward": [1, 0, 0],
            "feet": [f"block{number}" for number in range(len(parts))],
            "body_length": 1.0,
        },
        "joints": {"kp": SOFT, "kd": 0.0, "torque_limit": 1.0},
        "joint": [
            {"match": joint, "kp": SOFT * strength, "torque_limit": strength}
            for joint, strength in joints
        ],
        "mirror": {"symmetric": False},
        "termination": {"min_up": -1.0, "height": [0.0, 1e6], "touch": False},
    }
    xml = body_xml(parts, step, gravity, friction, height, "stand", opponent)
    return {"creature.xml": xml, "creature.toml": tomli_w.dumps(document)}


def resting_height(parts: Sequence[Part]) -> float:
    """Return the root's height in m, with the lowest corner on the ground and all angles at 0."""
    model = mujoco.MjModel.from_xml_string(body_xml(parts, 0.01, 0.0, None))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(data.body("part0").xpos[2] - lowest(model, data))
