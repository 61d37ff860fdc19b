"""Missing meshes: their shapes are dropped, but never a mass that only they state."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import mujoco

from mjxgait.errors import UserError

SMALL = "0 0 0 1e-3 0 0 0 1e-3 0 0 0 1e-3"
"""m; corners of the stand-in for a mesh until its shapes are removed."""


def put_stand_in(mesh: ET.Element) -> None:
    """Replace an MJCF mesh by a small one without a file, so that the model can be read."""
    name = mesh.get("name", "")
    mesh.attrib.clear()
    mesh.attrib.update(name=name, vertex=SMALL)


def leave_out(spec: mujoco.MjSpec, missing: Mapping[str, str]) -> None:
    """Remove meshes and their shapes from a model that has been read.

    Args:
      missing: mesh names, each with the file that it should have come from.

    Raises:
      UserError: a shape's mass counts; names the mass, as far as the file states it.
    """
    for geom in list(spec.geoms):
        if geom.meshname in missing:
            if _counts(spec, geom):
                raise lost(geom.name, geom.parent.name, missing[geom.meshname], geom.mass)
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name in missing:
            spec.delete(mesh)


def _counts(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Return whether a body weighs less without this shape."""
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    low, high = spec.compiler.inertiagrouprange
    weighs = geom.mass > 0 if geom.mass == geom.mass else geom.density > 0
    moves = geom.parent.name != "world"
    stated = geom.parent.explicitinertial and not always
    return bool(moves and weighs and not stated and low <= geom.group <= high)


def lost(shape: str, body: str, file: str, mass: float = float("nan")) -> UserError:
    """Return the error for a mass that would be lost. mass: kg; NaN if only the mesh states it."""
    of = f'"{shape}" of body "{body}"' if shape else f'a shape of body "{body}"'
    weight = f"{mass:.3g} kg" if mass == mass else "a mass that only its mesh tells"
    return UserError(
        f'{of} has {weight}, and its mesh "{file}" cannot be read: put the file beside the model, '
        "name its folder with --search, or state the body's mass in an <inertial>"
    )
