"""Text of creature.xml: bodies, inertias, joints and shapes as they are, on a floor.

Every physics backend can simulate its options.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature.creature import REST
from mjxgait.errors import UserError
from mjxgait.importer.parts import GEOM, Body, Shape

KINDS = {
    int(GEOM.mjGEOM_SPHERE): ("sphere", 1),
    int(GEOM.mjGEOM_CAPSULE): ("capsule", 2),
    int(GEOM.mjGEOM_CYLINDER): ("cylinder", 2),
    int(GEOM.mjGEOM_ELLIPSOID): ("ellipsoid", 3),
    int(GEOM.mjGEOM_BOX): ("box", 3),
}
HEAD = """
  <compiler angle="radian" autolimits="false" inertiafromgeom="false"/>
  <option timestep="0.005" integrator="Euler" cone="pyramidal" solver="Newton" iterations="3" ls_iterations="8">
    <flag eulerdamp="disable"/>
  </option>
  <visual>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.45 0.45 0.45" specular="0.05 0.05 0.05"/>
  </visual>
  <default>
    <joint type="hinge" limited="false"/>
    <geom density="0"/>
    <default class="visual"><geom contype="0" conaffinity="0" group="1"/></default>
    <default class="collider"><geom contype="0" conaffinity="1"/></default>
  </default>
"""
FLOOR = """
    <geom name="floor" type="plane" size="0 0 0.05" contype="1" conaffinity="0" priority="1" friction="0.9 0.005 0.0001"
          solref="0.01 1" rgba="0.42 0.47 0.42 1"/>
"""


def creature_xml(
    name: str, bodies: list[Body], stand: np.ndarray | None, rest: np.ndarray | None = None
) -> str:
    """Return the text of creature.xml. stand, rest: [nq] keyframes of these names, or None."""
    root = ET.fromstring(f"<mujoco>{HEAD}<asset/><worldbody>{FLOOR}</worldbody></mujoco>")
    root.set("model", name)
    asset, world = root.find("asset"), root.find("worldbody")
    assert asset is not None
    assert world is not None
    elements: list[ET.Element] = []
    for body in bodies:
        parent = world if body.parent < 0 else elements[body.parent]
        elements.append(_body(parent, body))
        for i, shape in enumerate(body.shapes):
            if shape.solid or shape.seen:
                _shape(elements[-1], asset, shape, f"{body.name}_mesh_{i}")
    keyframes = {"stand": stand, REST: rest}
    if stand is not None:
        section = ET.SubElement(root, "keyframe")
        for key, qpos in keyframes.items():
            if qpos is not None:
                ET.SubElement(section, "key", name=key, qpos=_text(qpos))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def compile_own(text: str) -> mujoco.MjModel:
    """Compile a text that the import wrote.

    Raises:
      UserError: the file's numbers do not survive being written, such as an axis of no length.
    """
    try:
        return mujoco.MjModel.from_xml_string(text)
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(
            "the repaired model does not compile; correct this in the file: "
            f"{' '.join(str(error).split())[:300]}"
        ) from None


def _text(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(repr(float(v)) if v else "0" for v in values)


def _body(parent: ET.Element, body: Body) -> ET.Element:
    element = ET.SubElement(
        parent, "body", name=body.name, pos=_text(body.pos), quat=_text(body.quat)
    )
    if body.parent < 0:
        ET.SubElement(element, "freejoint", name="root")
    for joint in body.joints:
        made = ET.SubElement(
            element, "joint", name=joint.name, pos=_text(joint.pos), axis=_text(joint.axis)
        )
        if np.isfinite(joint.low):
            made.set("range", _text((joint.low, joint.high)))
        if joint.stopped:
            made.set("limited", "true")
        if joint.ref:
            made.set("ref", repr(joint.ref))
        if joint.armature:
            made.set("armature", repr(joint.armature))
    if body.mass > 0:
        inertia = {
            "pos": _text(body.ipos),
            "quat": _text(body.iquat),
            "mass": repr(body.mass),
            "diaginertia": _text(body.inertia),
        }
        ET.SubElement(element, "inertial", inertia)
    return element


def _shape(parent: ET.Element, asset: ET.Element, shape: Shape, mesh: str) -> None:
    geom = ET.SubElement(parent, "geom", {"class": "collider" if shape.solid else "visual"})
    if shape.name:
        geom.set("name", shape.name)
    if shape.solid and not shape.seen:
        geom.set("group", "3")
    if shape.kind in KINDS:
        kind, sizes = KINDS[shape.kind]
        geom.attrib.update(
            type=kind, size=_text(shape.size[:sizes]), pos=_text(shape.pos), quat=_text(shape.quat)
        )
    elif _has_volume(shape.points):
        ET.SubElement(
            asset,
            "mesh",
            name=mesh,
            vertex=" ".join(f"{v:.4g}" for v in shape.points.ravel()),
            inertia="shell",
        )
        geom.attrib.update(type="mesh", mesh=mesh)
    else:
        low, high = shape.points.min(0), shape.points.max(0)
        geom.attrib.update(
            type="box", pos=_text((low + high) / 2), size=_text(np.maximum((high - low) / 2, 1e-4))
        )
    geom.set("rgba", " ".join(f"{v:.3g}" for v in np.clip(shape.rgba, 0, 1)))


def _has_volume(points: np.ndarray) -> bool:
    if len(points) < 4:
        return False
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spread[2] > 0.02 * spread[0])
