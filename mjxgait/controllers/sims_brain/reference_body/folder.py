"""Export of a grown body to the two files of a creature, which open like any other creature's."""

from collections.abc import Sequence

import mujoco
import tomli_w

from mjxgait.controllers.sims_brain.reference_body.parts import Part
from mjxgait.controllers.sims_brain.reference_body.xml import body_xml
from mjxgait.creature.geometry import lowest
from mjxgait.errors import UserError

SOFT = 0.01
"""1/rad: kp of a hinge over its strength. A brain sends torques, so nothing tracks a pose."""


def body_files(
    parts: Sequence[Part],
    name: str,
    step: float,
    gravity: float,
    friction: float | None,
    around: str,
) -> dict[str, str]:
    """Return `creature.xml` and `creature.toml`. around: its medium, for the description.

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
    height = _resting_height(body_xml(parts, step, gravity, friction))
    document = {
        "creature": {
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
    xml = body_xml(parts, step, gravity, friction, height, keyframe="stand")
    return {"creature.xml": xml, "creature.toml": tomli_w.dumps(document)}


def _resting_height(xml: str) -> float:
    """Return the root's height in m, with the lowest corner on the ground and all angles at 0."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(data.body("part0").xpos[2] - lowest(model, data))
