"""A grown body as a MuJoCo model with true blocks and hinges."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from mjxgait.blocks.phenotype import DENSITY, Body
from mjxgait.physics.trees.tree import Surroundings


def body_xml(body: Body, around: Surroundings, height: float = 1.0) -> str:
    """The model's text. body: arrays of one lane, in NumPy. height: m of the root's middle.

    Parts are called `part0` (the root), `part1`, … and their hinges `part1_0`, `part1_1`, ….
    """
    root = ET.Element("mujoco", model="blocks")
    ET.SubElement(root, "compiler", angle="radian")
    option = ET.SubElement(
        root, "option", timestep=f"{around.step:g}", gravity=_text((0, 0, -around.gravity))
    )
    ET.SubElement(option, "flag", eulerdamp="disable")
    world = ET.SubElement(root, "worldbody")
    if around.floor:
        ET.SubElement(
            world,
            "geom",
            name="floor",
            type="plane",
            size="0 0 1",
            contype="0",
            conaffinity="1",
            friction=_text((around.friction, 0.005, 0.0001)),
        )
    places = {-1: world}
    for part in np.flatnonzero(body.parts.exists):
        parent = -1 if part == 0 else int(body.parts.parent[part])
        places[int(part)] = _part(places[parent], body, int(part), around, height)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def _part(
    above: ET.Element, body: Body, part: int, around: Surroundings, height: float
) -> ET.Element:
    """The part within its parent's element."""
    parts, tree = body.parts, body.tree
    place = (0.0, 0.0, height) if part == 0 else parts.place[part]
    own = ET.SubElement(above, "body", name=f"part{part}", pos=_text(place))
    if part == 0:
        ET.SubElement(own, "freejoint", name="root")
    else:
        own.set("quat", _text(_quaternion(np.asarray(parts.turn[part]))))
    for link in np.flatnonzero((body.part == part) & (tree.moves > 0)):
        ET.SubElement(
            own,
            "joint",
            name=f"part{part}_{int(body.hinge[link])}",
            axis=_text(np.eye(3)[int(body.axis[link])]),
            limited="true",
            range=_text((tree.low[link], tree.high[link])),
            armature=_text((tree.armature[link],)),
            damping=_text((tree.damping[link],)),
        )
    half = parts.half[part]
    ET.SubElement(
        own,
        "geom",
        name=f"block{part}",
        type="box",
        size=_text(half),
        pos=_text((0 if part == 0 else half[0], 0, 0)),
        density=f"{DENSITY:g}",
        friction=_text((around.friction, 0.005, 0.0001)),
        contype="1",
        conaffinity="0",
    )
    return own


def _quaternion(rows: np.ndarray) -> np.ndarray:
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(rows.T, float).reshape(9))
    return found


def _text(values: Iterable[Any]) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)
