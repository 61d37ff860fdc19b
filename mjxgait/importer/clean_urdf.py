"""Cleaning of URDF files for MuJoCo's reader.

Meshes are loaded or dropped, broken inertias mended, efforts read.
"""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from mjxgait.errors import UserError, did_you_mean, listed
from mjxgait.importer.notes import Notes
from mjxgait.importer.source import Places, Source, load_mesh, lost_mass, numbers

KEPT = ("link", "joint", "material")
COMPILER = {
    "fusestatic": "false",
    "discardvisual": "false",
    "strippath": "false",
    "angle": "radian",
}
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
LEAST_MASS = 1e-6
"""kg, below which a link counts as massless."""
LEAST_INERTIA = 1e-12
"""kg·m², a principal moment below which MuJoCo ignores an inertia."""


def clean_urdf(source: Source, path: Path, places: Places, notes: Notes) -> None:
    """Clean `source.tree` in place.

    Raises:
      UserError: it is a xacro template, or has no links.
    """
    robot = source.tree
    if any(
        "xacro" in element.tag or any("${" in v for v in element.attrib.values())
        for element in robot.iter()
    ):
        raise UserError(
            f"{path}: is a xacro template; give it the suffix .xacro, so that it is expanded first"
        )
    for element in list(robot):
        if element.tag not in KEPT:
            robot.remove(element)
    if not robot.findall("link"):
        raise UserError(f"{path}: a URDF without a <link>; this is not a robot")
    _check_tree(robot, path)
    for element in robot.iter("material"):
        for texture in element.findall("texture"):
            element.remove(texture)
    for element in robot.iter("origin"):
        for key in ("xyz", "rpy"):
            values = numbers(element.get(key))
            if element.get(key) is not None and (values is None or len(values) != 3):
                values = ((values or []) + [0.0] * 3)[:3]
                element.set(key, " ".join(map(repr, values)))
                notes.change(f"an origin's {key} read as {values}", "it has not three numbers")
    for link in robot.findall("link"):
        _shapes(source, link, _inertial(link, notes), places, notes)
    for joint in robot.findall("joint"):
        _joint(source, joint, notes)
    if source.coupled:
        notes.change(
            f"joints {listed(source.coupled)} frozen", "they follow other joints (<mimic>)"
        )
    extension = ET.Element("mujoco")
    ET.SubElement(extension, "compiler", COMPILER)
    robot.insert(0, extension)


def _check_tree(robot: ET.Element, path: Path) -> None:
    """Refuse names that occur twice, and joints that do not form a tree.

    Raises:
      UserError: names the link or the joint.
    """
    for kind in ("link", "joint"):
        if twice := _repeated(element.get("name", "") for element in robot.findall(kind)):
            raise UserError(f'{path}: two {kind}s are named "{twice}"; rename one of them')
    links = {link.get("name", "") for link in robot.findall("link")}
    above: dict[str, str] = {}
    for joint in robot.findall("joint"):
        parent, child = (_end(joint, side) for side in ("parent", "child"))
        for link in (parent, child):
            if link not in links:
                name = joint.get("name", "")
                raise UserError(
                    f'{path}: joint "{name}" is on link "{link}", which the file does not have; '
                    f"{did_you_mean(link, links)}"
                )
        if child in above:
            raise UserError(
                f'{path}: link "{child}" is the child of two joints, which closes a loop; only '
                "trees can be simulated here, so take one of them out"
            )
        above[child] = parent
    _check_rooted(above, path)


def _check_rooted(above: Mapping[str, str], path: Path) -> None:
    """Refuse links in a ring. above: the parent of each link that has one."""
    rooted: set[str] = set()
    for link in above:
        way: set[str] = set()
        while link in above and link not in rooted:
            if link in way:
                raise UserError(
                    f'{path}: the joints above link "{link}" lead back to it; take one of them out'
                )
            way.add(link)
            link = above[link]
        rooted |= way


def _repeated(names: Iterable[str]) -> str:
    """First name that occurs twice; empty if none does."""
    return next((name for name, count in Counter(names).items() if count > 1), "")


def _end(joint: ET.Element, side: str) -> str:
    """Name of the link on a side of a joint, parent or child; empty if none is stated."""
    element = joint.find(side)
    return element.get("link", "") if element is not None else ""


def _shapes(source: Source, link: ET.Element, stated: bool, places: Places, notes: Notes) -> None:
    """Load a link's meshes, and drop missing ones.

    Args:
      stated: whether its mass is; if not, a mesh's mass counts.
    """
    for kind in ("visual", "collision"):
        for shape in link.findall(kind):
            shape.attrib.pop("name", None)
            if _empty_shape(shape):
                link.remove(shape)
                notes.change(f'a shape of link "{link.get("name", "")}" dropped', "it has no size")
                continue
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            reference = mesh.get("filename", "")
            key = load_mesh(source, places, reference, [""], notes)
            if key is None:
                if kind == "collision" and not stated:
                    raise lost_mass("", link.get("name", ""), reference)
                link.remove(shape)
            else:
                mesh.set("filename", key)


def _empty_shape(shape: ET.Element) -> bool:
    """Return whether a shape's size is missing or has a part that is not positive."""
    geometry = shape.find("geometry")
    if geometry is None or not len(geometry):
        return True
    kind = geometry[0]
    if kind.tag == "mesh":
        return not kind.get("filename")
    sizes = [
        numbers(kind.get(key)) for key in ("size", "radius", "length") if kind.get(key) is not None
    ]
    return not sizes or any(not size or min(size) <= 0 for size in sizes)


def _inertial(link: ET.Element, notes: Notes) -> bool:
    """Mend an impossible inertia, not the mass; return whether a mass is stated (zero counts)."""
    inertial = link.find("inertial")
    if inertial is None:
        return False
    name = link.get("name", "")
    stated = inertial.find("mass")
    mass = numbers(stated.get("value")) if stated is not None else None
    if not mass or mass[0] < 0:
        link.remove(inertial)
        notes.change(f'inertia of link "{name}" dropped', "its mass is missing or negative")
        return False
    if mass[0] < LEAST_MASS:
        link.remove(inertial)
        if link.find("collision") is not None or link.find("visual") is not None:
            what = f'mass of link "{name}" taken from its shapes, as of water'
            notes.change(what, f"the stated mass is {mass[0]:g} kg")
        return True
    inertia = inertial.find("inertia")
    values = [
        numbers((inertia.attrib if inertia is not None else {}).get(key, "0")) or [0.0]
        for key in TENSOR
    ]
    xx, xy, xz, yy, yz, zz = (v[0] for v in values)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments, axes = np.linalg.eigh(tensor)
    if moments[0] > LEAST_INERTIA and moments[2] <= moments[0] + moments[1] + 1e-12:
        return True
    some = moments[2] > LEAST_INERTIA
    mended = _possible(moments, mass[0]) if some else np.full(3, _ball_inertia(mass[0]))
    tensor = axes @ np.diag(mended) @ axes.T
    inertia = inertia if inertia is not None else ET.SubElement(inertial, "inertia")
    for key, (i, j) in zip(TENSOR, ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)), strict=True):
        inertia.set(key, repr(float(tensor[i, j])))
    notes.change(
        f'inertia of link "{name}" mended: principal moments '
        f"{np.array2string(mended, precision=3)}",
        f"no body has the stated ones, {np.array2string(moments, precision=3)} kg m²",
    )
    return True


def _ball_inertia(mass: float) -> float:
    """Inertia in kg·m² of a ball of water."""
    return 0.4 * mass * (3 * mass / (4 * np.pi * 1000.0)) ** (2 / 3)


def _possible(moments: np.ndarray, mass: float) -> np.ndarray:
    """Nearest principal moments [3] kg·m² that some body of this mass in kg can have."""
    least = max(float(np.abs(moments).max()) * 1e-2, mass * 1e-6)
    raised = np.maximum(moments, least)
    raised[2] = min(raised[2], raised[0] + raised[1])
    if raised[2] < moments[2]:  # the largest is the most reliable: raise the others
        raised[2] = moments[2]
        raised[:2] *= 1.0001 * moments[2] / (raised[0] + raised[1])
    return raised


def _order_limits(joint: str, limit: ET.Element, notes: Notes) -> None:
    """Swap limits in the wrong order, with which MuJoCo leaves a joint without limits."""
    low, high = (numbers(limit.get(key, "0")) or [0.0] for key in ("lower", "upper"))
    if low[0] > high[0]:
        limit.set("lower", repr(high[0]))
        limit.set("upper", repr(low[0]))
        notes.change(f'limits of joint "{joint}" swapped', "the upper one was the smaller")


def _joint(source: Source, joint: ET.Element, notes: Notes) -> None:
    name = joint.get("name", "")
    limit = joint.find("limit")
    effort = numbers((limit.attrib if limit is not None else {}).get("effort"))
    if effort and effort[0] > 0:
        source.efforts[name] = effort[0]
    if limit is not None:
        _order_limits(name, limit, notes)
    mimic = joint.find("mimic")
    if mimic is not None:
        source.coupled.append(name)
        joint.remove(mimic)
    for unknown in ("safety_controller", "calibration", "transmission"):
        for element in joint.findall(unknown):
            joint.remove(element)
    if joint.get("type") == "planar":
        joint.set("type", "fixed")
        notes.change(f'joint "{name}" fixed', "planar joints are not read inside a body")
