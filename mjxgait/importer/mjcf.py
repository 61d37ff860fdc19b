"""MJCF cleaning: includes put in place, meshes loaded, unneeded elements removed."""

import xml.etree.ElementTree as ET
from pathlib import Path

from mjxgait.errors import UserError
from mjxgait.importer.missing import put_stand_in
from mjxgait.importer.notes import Notes
from mjxgait.importer.source import (
    MOST_ELEMENTS,
    MOST_INCLUDES,
    Places,
    Source,
    load_mesh,
    numbers,
    parse_xml,
)

DROPPED = {
    "sensor": "a sensor has no part in walking",
    "visual": "it only concerns the picture",
    "statistic": "it only concerns the picture",
    "size": "memory is sized by what is there",
    "extension": "plugins are code, and no code of a model is run",
    "deformable": "soft parts cannot be simulated here",
}
INNER = {
    "plugin": "plugins are code, and no code of a model is run",
    "composite": "soft or repeated parts cannot be simulated here",
    "flexcomp": "soft parts cannot be simulated here",
    "attach": "another model inside the model is not read",
    "camera": "it is not part of the body",
    "light": "it is not part of the body",
    "site": "",
    "texture": "",
    "skin": "",
    "hfield": "the floor is always flat",
    "model": "another model inside the model is not read",
}
COMPILER_FOLDERS = ("meshdir", "texturedir", "assetdir")
MOST_COPIES = 64


def clean_mjcf(source: Source, path: Path, places: Places, notes: Notes) -> None:
    """Clean `source.tree` in place.

    Raises:
      UserError: an include that cannot be read.
    """
    tree = source.tree
    _include(tree, path, places, [0, 0])
    folders = _compiler(tree)
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
            if name == "sensor" or name in ("extension", "deformable"):
                notes.change(f"<{name}> dropped", why)
    for name in ("custom", "default"):
        _empty(tree, name)
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


def _include(tree: ET.Element, path: Path, places: Places, count: list[int]) -> None:
    """Put the content of included files in place, as MuJoCo does.

    count: files and elements so far.
    """
    for parent in list(tree.iter()):
        for i, child in reversed(list(enumerate(parent))):
            if child.tag != "include":
                continue
            reference = child.get("file", "")
            found = places.find(reference)
            count[0] += 1
            if found is None or count[0] > MOST_INCLUDES:
                raise UserError(
                    f'{path}: <include file="{reference[:200]}"> is missing, outside of the model\'s folder, or one too many; '
                    "put it beside the model or name its folder with --search"
                )
            inner = parse_xml(found)
            _include(inner, found, places, count)
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


def _empty(tree: ET.Element, name: str) -> None:
    """Remove <custom>; <default> stays."""
    for element in tree.findall(name):
        if name == "custom":
            tree.remove(element)


def _drop_inner(tree: ET.Element, notes: Notes) -> None:
    # Sites carry tendons, actuators and equality constraints: those stay readable for now and sites
    # with them.
    dropped = {k: v for k, v in INNER.items() if k != "site"}
    total = 1.0
    parents = [(parent, child) for parent in tree.iter() for child in list(parent)]
    for parent, child in parents:
        if child.tag in dropped:
            parent.remove(child)
            if dropped[child.tag] and child.tag not in ("camera", "light"):
                notes.change(
                    f"<{child.tag}> {child.get('name', '')} dropped".replace("  ", " "),
                    dropped[child.tag],
                )
        elif child.tag == "replicate":
            copies = numbers(child.get("count"))
            total *= max(copies[0], 1.0) if copies else MOST_COPIES + 1
            if total > MOST_COPIES:
                raise UserError(
                    f'<replicate count="{child.get("count", "")[:20]}"> is more than a creature needs; write its parts out'
                )


def _drop_unreadable(source: Source, places: Places, folders: list[str], notes: Notes) -> None:
    """Load meshes, with small ones in place of unreadable ones; remove geoms of height fields."""
    for asset in source.tree.findall("asset"):
        for mesh in list(asset.findall("mesh")):
            reference = mesh.attrib.pop("file", None)
            if reference is None:
                continue
            name = mesh.get("name") or Path(reference).stem
            mesh.set("name", name)
            key = load_mesh(source, places, reference, folders, notes)
            if key is None:
                put_stand_in(mesh)
                source.missing[name] = reference
            else:
                mesh.set("file", key)
                mesh.attrib.pop("content_type", None)
    for parent in list(source.tree.iter()):
        for geom in parent.findall("geom"):
            if geom.get("type") in ("hfield", "sdf") or "hfield" in geom.attrib:
                parent.remove(geom)
