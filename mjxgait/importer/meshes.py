"""Meshes in formats that MuJoCo cannot read, converted to OBJ.

The files are untrusted: call this in the process with limited time and memory (`worker`).
"""

import io
import math
import re
from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

if TYPE_CHECKING:
    import trimesh

FOREIGN = (".dae", ".glb", ".ply")
"""Formats that `converted` reads."""
MOST_FACES = 2_000_000
Y_UP = re.compile(rb"<up_axis>\s*Y_UP")
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation that takes y to z."""


def foreign(key: str) -> str:
    """Return the format of a mesh by its key in `Source.assets`; "" if MuJoCo reads it."""
    return next((suffix for suffix in FOREIGN if key.endswith(f"{suffix}.obj")), "")


def with_y_up(assets: dict[str, bytes]) -> list[str]:
    """Return the keys of the COLLADA meshes in files that state y as up."""
    return [key for key in assets if foreign(key) == ".dae" and Y_UP.search(assets[key])]


def convert(
    assets: dict[str, bytes],
    failed: Callable[[str, str], object],
    upright: Collection[str] = (),
) -> None:
    """Convert all meshes that MuJoCo cannot read, in place.

    failed: called with the key and the reason for each mesh that cannot be read; it becomes empty.
    upright: keys of those to turn so that y becomes z.
    """
    for key in [key for key in assets if foreign(key)]:
        try:
            turn = UPRIGHT if key in upright else np.eye(3)
            assets[key] = converted(assets[key], foreign(key), turn)
        except MemoryError:
            raise
        except Exception as error:  # of four readers of other projects, for damaged files
            assets[key] = b""
            failed(key, " ".join(f"{type(error).__name__}: {error}".split())[:160])


def converted(data: bytes, suffix: str, turn: np.ndarray | None = None) -> bytes:
    """Return a mesh as the text of an OBJ file, in m; the parts of a scene become one.

    The unit of a COLLADA file counts; of its up axis see `misfit`. turn: [3, 3] rotation.

    Raises:
      ValueError: no triangles, too many, or a coordinate that is not finite. Others: damaged.
    """
    import trimesh
    from trimesh.exchange.obj import export_obj

    scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], resolver=None)
    parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    _check(parts)
    for part in parts:
        if part.units:
            part.convert_units("meters")
    mesh = trimesh.util.concatenate(parts)
    assert isinstance(mesh, trimesh.Trimesh)
    vertices = mesh.vertices if turn is None else mesh.vertices @ turn.T
    plain = trimesh.Trimesh(vertices, mesh.faces, process=False)
    text = export_obj(plain, include_normals=False, include_color=False, include_texture=False)
    return str(text).encode()


def _check(parts: "Sequence[trimesh.Trimesh]") -> None:
    faces = sum(len(part.faces) for part in parts)
    if not 0 < faces <= MOST_FACES:
        raise ValueError(f"{faces} triangles; 1 to {MOST_FACES} are read")
    if not all(math.isfinite(float(abs(part.vertices).max())) for part in parts):
        raise ValueError("a coordinate is not finite")


def misfit(model: mujoco.MjModel) -> float:
    """Return how far in m the links' meshes are from the joints at their ends, summed over both.

    Robot viewers disagree on whether the up axis of a COLLADA file counts, and so do the files that
    were made for them. Where meshes reach the joints of their links, the choice is right.
    """
    ends: dict[int, list[np.ndarray]] = {}
    for body in range(1, model.nbody):
        ends.setdefault(body, []).append(np.zeros(3))
        ends.setdefault(int(model.body_parentid[body]), []).append(model.body_pos[body])
    return sum(_distances(model, body, np.array(points)) for body, points in ends.items() if body)


def _distances(model: mujoco.MjModel, body: int, points: np.ndarray) -> float:
    """Return the sum of the distances in m from points [n, 3] to a body's meshes' boxes.

    0 for a body without a mesh.
    """
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    apart = []
    for geom in range(first, first + count):
        if int(model.geom_type[geom]) != mujoco.mjtGeom.mjGEOM_MESH:
            continue
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        centre, half = np.split(model.geom_aabb[geom], 2)
        inside = (points - model.geom_pos[geom]) @ rotation.reshape(3, 3) - centre
        apart.append(np.linalg.norm(np.maximum(np.abs(inside) - half, 0.0), axis=1))
    return float(np.min(apart, axis=0).sum()) if apart else 0.0
