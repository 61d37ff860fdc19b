"""Cleaning of MJCF files for MuJoCo's reader: includes are read, meshes loaded, much is dropped."""

import itertools
import math
import xml.etree.ElementTree as ET
from pathlib import Path

from mjxgait.errors import UserError, listed
from mjxgait.importer.notes import Notes
from mjxgait.importer.source import (
    MOST_ELEMENTS,
    MOST_INCLUDES,
    MOST_NESTED,
    Places,
    Source,
    load_mesh,
    numbers,
    parse_xml,
)

DROPPED = {
    "sensor": "a sensor has no part in walking",
    "extension": "plugins are code, and no code of a model is run",
    "deformable": "soft parts cannot be simulated here",
    "visual": "",
    "statistic": "",
    "size": "",
    "custom": "",
}
INNER = {
    "plugin": "plugins are code, and no code of a model is run",
    "composite": "soft or repeated parts cannot be simulated here",
    "flexcomp": "soft parts cannot be simulated here",
    "attach": "another model inside the model is not read",
    "hfield": "the floor is always flat",
    "model": "another model inside the model is not read",
    "camera": "",
    "light": "",
    "texture": "",
    "skin": "",
}
"""Sections, and elements anywhere, that are dropped, with the reason; "" is not reported.

Sites stay, because tendons, actuators and equality constraints refer to them.
"""
COMPILER_FOLDERS = ("meshdir", "texturedir", "assetdir")
MOST_COPIES = 64
FEW_RANGES = 3
"""Joints with limits from which on their sizes show in which unit they are."""


def clean_mjcf(source: Source, path: Path, places: Places, notes: Notes) -> None:
    """Clean `source.tree` in place.

    Raises:
      UserError: an include that cannot be read.
    """
    tree = source.tree
    _include(tree, path, places, [0, 0])
    folders = _compiler(tree)
    _radians(tree, notes)
    _order_ranges(tree, notes)
    source.poses = [
        n
        for n in (
            numbers(e.get("data")) for e in tree.iter("numeric") if e.get("name") == "init_qpos"
        )
        if n
    ]
    for name, why in DROPPED.items():
        for element in tree.findall(name):
            tree.remove(element)
            if why:
                notes.change(f"<{name}> dropped", why)
    _drop_inner(tree, notes)
    _drop_unreadable(source, places, folders, notes)
    for element in tree.iter():
        for key in [
            k
            for k in element.attrib
            if k.startswith("file") and not (element.tag == "mesh" and k == "file")
        ]:
            del element.attrib[key]
        for key in ("texture", "plugin", "instance"):
            element.attrib.pop(key, None)
    known = {material.get("name") for material in tree.iter("material")}
    for element in tree.iter():
        if element.get("material") not in known:
            element.attrib.pop("material", None)


def _include(
    tree: ET.Element, path: Path, places: Places, count: list[int], depth: int = 0
) -> None:
    """Put the content of included files in place, as MuJoCo does.

    count: files and elements so far. depth: number of files that this one is included through.
    """
    for parent in list(tree.iter()):
        for i, child in reversed(list(enumerate(parent))):
            if child.tag != "include":
                continue
            reference = child.get("file", "")
            found = places.find(reference)
            count[0] += 1
            if found is None or count[0] > MOST_INCLUDES or depth > MOST_NESTED:
                raise UserError(
                    f'{path}: <include file="{reference[:200]}"> is missing, outside of the '
                    "model's folder, or one too many; put it beside the model or name "
                    "its folder with --search"
                )
            inner = parse_xml(found)
            _include(inner, found, places, count, depth + 1)
            count[1] += sum(1 for _ in inner.iter())
            if count[1] > MOST_ELEMENTS:
                raise UserError(f"{path}: its includes hold more than {MOST_ELEMENTS} elements")
            parent.remove(child)
            for offset, element in enumerate(inner):
                parent.insert(i + offset, element)


def _compiler(tree: ET.Element) -> list[str]:
    """Remove folders and file handling from <compiler>; return the mesh folders."""
    folders = [""]
    for compiler in tree.findall("compiler"):
        for key in COMPILER_FOLDERS:
            value = compiler.attrib.pop(key, None)
            if value is not None and key != "texturedir":
                folders.insert(0, value)
        for key in ("discardvisual", "fusestatic", "strippath", "usethread"):
            compiler.attrib.pop(key, None)
    return folders


def _radians(tree: ET.Element, notes: Notes) -> None:
    """State that angles are in radians if the file does not say, and no joint could move else."""
    if any("angle" in compiler.attrib for compiler in tree.findall("compiler")):
        return
    joints = [joint for joint in tree.iter("joint") if joint.get("type") != "slide"]
    stated = [numbers(joint.get("range")) or [] for joint in joints]
    turns = [numbers(element.get("euler")) or [] for element in tree.iter()]
    angles = [abs(angle) for angle in itertools.chain(*stated, *turns)]
    if sum(map(bool, stated)) >= FEW_RANGES and max(angles) <= math.tau:
        tree.append(ET.Element("compiler", angle="radian"))
        notes.change("angles read as radians", "in degrees no joint could move by more than 6.3")


def _order_ranges(tree: ET.Element, notes: Notes) -> None:
    """Swap limits in the wrong order, with which MuJoCo leaves a joint without limits."""
    swapped = []
    for joint in tree.iter("joint"):
        match numbers(joint.get("range")):
            case [low, high] if low > high:
                joint.set("range", f"{high!r} {low!r}")
                swapped.append(joint.get("name") or joint.get("class") or "of a class")
    if swapped:
        notes.change(f"limits of joints {listed(swapped)} swapped", "the upper one was the smaller")


def _drop_inner(tree: ET.Element, notes: Notes) -> None:
    total = 1.0
    parents = [(parent, child) for parent in tree.iter() for child in list(parent)]
    for parent, child in parents:
        if child.tag in INNER:
            parent.remove(child)
            if why := INNER[child.tag]:
                what = f"<{child.tag}> {child.get('name', '')} dropped".replace("  ", " ")
                notes.change(what, why)
        elif child.tag == "replicate":
            copies = numbers(child.get("count"))
            total *= max(copies[0], 1.0) if copies else MOST_COPIES + 1
            if total > MOST_COPIES:
                raise UserError(
                    f'<replicate count="{child.get("count", "")[:20]}"> is more than a creature '
                    "needs; write its parts out"
                )


def _drop_unreadable(source: Source, places: Places, folders: list[str], notes: Notes) -> None:
    """Load meshes, and list those that cannot be read; remove geoms of height fields."""
    for asset in source.tree.findall("asset"):
        for mesh in list(asset.findall("mesh")):
            reference = mesh.attrib.pop("file", None)
            if reference is None:
                continue
            mesh.set("name", mesh.get("name") or Path(reference).stem)
            key = load_mesh(source, places, reference, folders, notes)
            if key is None:
                key = f"missing{len(source.missing)}.obj"
                source.missing[key] = reference
            mesh.set("file", key)
            mesh.attrib.pop("content_type", None)
    for parent in list(source.tree.iter()):
        for geom in parent.findall("geom"):
            if geom.get("type") in ("hfield", "sdf") or "hfield" in geom.attrib:
                parent.remove(geom)
