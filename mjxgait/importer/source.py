"""Reading of a model file and its references.

The file is untrusted: only its folder, its package and the search paths are read, and everything
is bounded.
"""

import dataclasses
import io
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

from mjxgait.errors import UserError
from mjxgait.files import read_bytes
from mjxgait.importer.meshes import FOREIGN
from mjxgait.importer.notes import Guess, Notes

MOST_XML = 4_000_000
MOST_MESH = 30_000_000
MOST_MESHES = 120_000_000
"""bytes of one XML file, of one mesh, of all meshes together."""
MOST_ELEMENTS, MOST_ATTRIBUTES, MOST_DEPTH, MOST_INCLUDES = 20_000, 100, 200, 40
"""Limits of elements, attributes per element, depth and includes.

MuJoCo's own elements have up to 40 attributes.
"""
MOST_NESTED = 2
"""Files that one is included through. Each may be `MOST_DEPTH` deep, and Python writes at most a
thousand levels."""
READABLE_MESHES = (".stl", ".obj", ".msh")
MODEL_FOLDERS = frozenset(("mjcf", "model", "models", "robots", "sdf", "urdf", "xml", "xmls"))
"""Names of a folder for models inside a package that holds their meshes in another folder."""
PACKAGE_DEPTH = 3
"""Folders above a model's in which its package is looked for."""


@dataclasses.dataclass
class Source:
    """Cleaned model file for MuJoCo: its tree refers to meshes by keys in `assets`, to no file.

    efforts: N·m, largest torque by joint name, if stated outside MuJoCo's elements.
    files: path of each mesh in `assets`, as the model states it.
    coupled: joints that follow others.
    poses: standing poses that the file offers outside keyframes.
    missing: keys of unavailable meshes, each with its expected file; MJCF only.
    up: axis that points up, of a skeleton. bones: its bones by the body that is made of each.
    limbs: the bodies of its limbs, which alone may be legs; None for other models. turned: of each
    body that hangs although the skeleton rests spread, the rotation [3, 3] from there. swings:
    names of the joints by which arms swing.
    """

    tree: ET.Element
    assets: dict[str, bytes] = dataclasses.field(default_factory=dict)
    files: dict[str, str] = dataclasses.field(default_factory=dict)
    efforts: dict[str, float] = dataclasses.field(default_factory=dict)
    coupled: list[str] = dataclasses.field(default_factory=list)
    poses: list[list[float]] = dataclasses.field(default_factory=list)
    missing: dict[str, str] = dataclasses.field(default_factory=dict)
    up: Guess | None = None
    bones: dict[str, str] = dataclasses.field(default_factory=dict)
    limbs: frozenset[str] | None = None
    turned: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    swings: frozenset[str] = frozenset()


class Places:
    """Folders that may be read: the model's, its package's and the search paths.

    They also resolve `package://` paths.
    """

    def __init__(self, model: Path, search: Sequence[Path]) -> None:
        self.home = model.resolve().parent
        package = _package(self.home)
        self.roots = [self.home, *(folder.resolve() for folder in search), *package]

    def find(self, reference: str, folders: Sequence[str] = ("",)) -> Path | None:
        """Return the referenced file; None if it is missing or outside the readable folders."""
        if "\0" in reference or len(reference) > 1000:
            return None
        uri = re.match(r"(?:package|model|file)://(.*)", reference)
        path = uri.group(1) if uri else reference.replace("\\", "/")
        tries = [self.home / folder / path for folder in folders]
        for root in self.roots:
            tries += (
                [root / path, root.parent / path]
                if path.split("/")[0] == root.name
                else [root / path]
            )
            if uri and "/" in path:
                tries.append(root / path.split("/", 1)[1])
        for candidate in tries:
            try:
                real = candidate.resolve()
                if real.is_file() and any(real.is_relative_to(root) for root in self.roots):
                    return real
            except (OSError, RuntimeError, ValueError):
                continue
        return None


def _package(home: Path) -> list[Path]:
    """Return the folder of the package that a model's folder belongs to, or nothing.

    A ROS package has a `package.xml`. Without one, models lie in a folder such as `urdf` beside one
    for their meshes.
    """
    near = [home, *home.parents][: PACKAGE_DEPTH + 1]
    marked = [folder for folder in near if (folder / "package.xml").is_file()]
    return marked[:1] or [folder for folder in near[1:2] if home.name.lower() in MODEL_FOLDERS]


def parse_xml(path: Path) -> ET.Element:
    """Parse the root element of a file.

    Raises:
      UserError: missing, too large, not XML, with a document type (entities can refer to files and
        grow without bound) or too deep.
    """
    return parse_text(read_bytes(path, MOST_XML), path)


def parse_text(data: bytes, path: Path) -> ET.Element:
    """Parse the root element of a text. path: its file, for messages; see `parse_xml`."""
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data or b"\0" in data:
        raise UserError(
            f"{path}: has a document type, entities or zero bytes, which are not read; save it as "
            "plain UTF-8 XML without them"
        )
    data = data[max(data.find(b"<?xml"), 0) :]  # some files have a comment before it
    try:
        return _bounded(path, ET.iterparse(io.BytesIO(data), ("start", "end")))
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UserError(f"{path}: not valid XML ({error})") from None


def _bounded(path: Path, events: Iterator[tuple[str, ET.Element]]) -> ET.Element:
    depth, count = 0, 0
    root: ET.Element | None = None
    for event, element in events:
        root = element if root is None else root
        depth += 1 if event == "start" else -1
        count += event == "start"
        if count > MOST_ELEMENTS or depth > MOST_DEPTH:
            raise UserError(
                f"{path}: more than {MOST_ELEMENTS} elements, or nested deeper than {MOST_DEPTH}; "
                "this is not a creature"
            )
        if len(element.attrib) > MOST_ATTRIBUTES:
            raise UserError(
                f"{path}: <{element.tag[:40]}> has {len(element.attrib)} attributes, more than "
                f"{MOST_ATTRIBUTES}; take out those that MuJoCo does not know"
            )
    if root is None:
        raise UserError(f"{path}: empty")
    return root


def load_mesh(
    source: Source, places: Places, reference: str, folders: Sequence[str], notes: Notes
) -> str | None:
    """Load a mesh and return its key in `source.assets`; None with a note if it is unusable."""
    suffix = Path(reference).suffix.lower()
    if suffix not in READABLE_MESHES + FOREIGN:
        known = ", ".join(READABLE_MESHES + FOREIGN)
        notes.change(
            f'mesh "{reference}" dropped',
            f'cannot read "{suffix or "no suffix"}"; save it as one of {known}',
        )
        return None
    path = places.find(reference, folders)
    if path is None:
        notes.change(
            f'mesh "{reference}" dropped',
            "not found in the model's folder, its package or a search path (name more with "
            "--search)",
        )
        return None
    size = path.stat().st_size
    if size > MOST_MESH or size + sum(map(len, source.assets.values())) > MOST_MESHES:
        notes.change(f'mesh "{reference}" dropped', "too large")
        return None
    try:
        data = path.read_bytes()
    except OSError as error:
        notes.change(f'mesh "{reference}" dropped', f"cannot be read ({error.strerror})")
        return None
    kind = suffix if suffix in READABLE_MESHES else f"{suffix}.obj"  # see `meshes.convert`
    new = f"asset{len(source.assets)}{kind}"
    key = next((k for k, v in source.assets.items() if v == data), new)
    source.assets[key] = data
    source.files.setdefault(key, reference)
    return key


def numbers(text: str | None) -> list[float] | None:
    """Parse the numbers of an attribute; None if there is none or one is not finite."""
    try:
        values = [float(part) for part in (text or "").split()]
    except ValueError:
        return None
    return values if values and all(map(math.isfinite, values)) else None


def leave_out(spec: mujoco.MjSpec, missing: Mapping[str, str]) -> None:
    """Remove meshes and their shapes from a model that has been read.

    Args:
      missing: files of the meshes, each with its name in the original file; "" if it can be found
        but not read.

    Raises:
      UserError: a shape's mass counts; names the mass, as far as the file states it.
    """
    files = {mesh.name: mesh.file for mesh in spec.meshes if mesh.file in missing}
    for geom in list(spec.geoms):
        if geom.meshname in files:
            if _counts(spec, geom):
                unreadable = f"{geom.meshname} (it is there, but not as MuJoCo wants it)"
                file = missing[files[geom.meshname]] or unreadable
                raise lost_mass(geom.name, geom.parent.name, file, geom.mass)
            spec.delete(geom)
    for name in files:
        spec.delete(spec.mesh(name))


def _counts(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Return whether a body weighs less without this shape."""
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    low, high = spec.compiler.inertiagrouprange
    weighs = geom.mass > 0 if geom.mass == geom.mass else geom.density > 0
    moves = geom.parent.name != "world"
    stated = geom.parent.explicitinertial and not always
    return bool(moves and weighs and not stated and low <= geom.group <= high)


def lost_mass(shape: str, body: str, file: str, mass: float = float("nan")) -> UserError:
    """Return the error for a mass that would be lost. mass: kg; NaN if only the mesh states it."""
    of = f'"{shape}" of body "{body}"' if shape else f'a shape of body "{body}"'
    weight = f"{mass:.3g} kg" if mass == mass else "a mass that only its mesh states"
    return UserError(
        f'{of} has {weight}, and its mesh "{file}" cannot be read: put the file beside the model, '
        "name its folder with --search, or state the body's mass in an <inertial>"
    )
