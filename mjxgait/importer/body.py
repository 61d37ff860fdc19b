"""Text of creature.xml, and the kinematic model of the creature as it will be written.

Every physics backend can simulate the options in the text. The model gives poses and mirror images.
Letters: `J` active joints, `B` bodies in the list's order (MuJoCo's ids less one).
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.creature import REST
from mjxgait.creature.geometry import quaternion, rotation
from mjxgait.errors import UserError
from mjxgait.importer.parts import GEOM, Body, Shape
from mjxgait.importer.skeleton import foot_tips, tip_points

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


FREE_POS, FREE_DOF = 7, 6


class KinematicModel:
    """Kinematic model of the bodies.

    low, high: [J] limits in rad, infinite where there is none. feet: for each foot the places of
    its bodies.
    """

    def __init__(self, bodies: list[Body], feet: list[int], in_plane: bool = False) -> None:
        """Compile the bodies. in_plane: whether the file lets the trunk move in a plane only."""
        self.bodies, self.in_plane = bodies, in_plane
        self.model = compile_own(creature_xml("puppet", bodies, None))
        self.data = mujoco.MjData(self.model)
        self.joints = [joint for body in bodies for joint in body.joints]
        self.names = [joint.name for joint in self.joints]
        self.low = np.array([joint.low for joint in self.joints])
        self.high = np.array([joint.high for joint in self.joints])
        self.feet = [self.welded(i) for i in feet]
        self.tips = [foot_tips(bodies, group) for group in self.feet]
        self.trunk = self.welded(0)
        self.mass = float(self.model.body_mass.sum())

    def welded(self, i: int) -> list[int]:
        """Return a moving body and the bodies fixed to it."""
        group = [i]
        for k in range(i + 1, len(self.bodies)):
            if self.bodies[k].parent in group and not self.bodies[k].joints:
                group.append(k)
        return group

    def segments(self) -> list[list[int]]:
        """Return all moving bodies, the trunk first, each with the bodies fixed to it."""
        return [self.welded(i) for i, body in enumerate(self.bodies) if i == 0 or body.joints]

    def leg(self, foot: int) -> list[int]:
        """Places in `joints` of the joints between the trunk and a foot, the highest first."""
        chain, i = [], self.feet[foot][0]
        while i > 0:
            chain.append(i)
            i = self.bodies[i].parent
        order = [name for i in reversed(chain) for name in (j.name for j in self.bodies[i].joints)]
        return [self.names.index(name) for name in order]

    def pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [B, 3] m and rotations [B, 3, 3] at joint angles [J], the trunk as placed."""
        self.data.qpos[:] = self.qpos(q)
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.xpos[1:].copy(), self.data.xmat[1:].reshape(-1, 3, 3).copy()

    def qpos(self, q: np.ndarray) -> np.ndarray:
        """Pose [nq] at joint angles [J], with the trunk as placed."""
        return np.concatenate(
            [self.bodies[0].pos, self.bodies[0].quat / np.linalg.norm(self.bodies[0].quat), q]
        )

    def centre_of_mass(self) -> np.ndarray:
        """Centre of mass [3] m in the latest pose."""
        mujoco.mj_comPos(self.model, self.data)
        return self.data.subtree_com[1].copy()

    def sole_points(self, xpos: np.ndarray, xrot: np.ndarray) -> list[np.ndarray]:
        """Sole points [n, 3] m of each foot; without shapes, the place of its farthest part."""
        soles = [tip_points(tips, xpos, xrot) for tips in self.tips]
        return [
            sole if len(sole) else xpos[group[-1:]]
            for sole, group in zip(soles, self.feet, strict=True)
        ]

    def shank_height(self, xpos: np.ndarray, xrot: np.ndarray) -> float:
        """Lowest point in m of the last parts of the legs, without their ends."""
        return min(
            float(tip_points(tips, xpos, xrot, far=False)[:, 2].min(initial=np.inf))
            for tips in self.tips
        )

    def jacobian(self, foot: int, at: np.ndarray) -> np.ndarray:
        """Motion [J, 3] m/rad of a point [3] m of a foot per joint, in the latest pose."""
        moves = np.zeros((len(self.joints), 3))
        for j in self.leg(foot):
            moves[j] = np.cross(self.data.xaxis[j + 1], at - self.data.xanchor[j + 1])
        return moves

    def mirror(
        self, forward: np.ndarray, q: np.ndarray, slack: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Partner and sign [J] under reflection in the vertical plane along `forward` [3].

        None for an unsymmetric body. slack: see `images`.
        """
        partner, sign = self.images(forward, q, slack)
        return None if (partner < 0).any() else (partner, sign)

    def images(
        self, forward: np.ndarray, q: np.ndarray, slack: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Partner [J] under that reflection, -1 for a joint without one, and sign [J].

        slack: tolerance of images, in units of the one for a creature's folder.
        """
        self.pose(q)
        mujoco.mj_comPos(self.model, self.data)
        left = np.cross([0.0, 0.0, 1.0], forward)
        frame = np.stack([forward, left, [0.0, 0.0, 1.0]])
        anchors, axes, carried = (
            (self.data.xanchor[1:] - self.data.xpos[1]) @ frame.T,
            self.data.xaxis[1:] @ frame.T,
            (self.data.subtree_com[self.model.jnt_bodyid[1:]] - self.data.xpos[1]) @ frame.T,
        )
        near = 0.02 * float(np.ptp(self.data.xanchor[1:], axis=0).max() + 0.05)
        slides = np.zeros(len(self.joints), bool)
        return geometry.mirror_images(anchors, axes, slides, carried, slack * near, slack)

    def turn(self, matrix: np.ndarray) -> None:
        """Turn the trunk and everything on it about the world's origin. matrix: [3, 3]."""
        root = self.bodies[0]
        root.pos, root.quat = matrix @ root.pos, quaternion(matrix @ rotation(root.quat))
