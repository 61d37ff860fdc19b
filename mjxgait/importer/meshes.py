"""Meshes in formats that MuJoCo cannot read, converted to OBJ.

The files are untrusted: call this in the process with limited time and memory (`worker`).
"""

import io
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import trimesh

FOREIGN = (".dae", ".glb", ".ply")
"""Formats that `converted` reads."""
MOST_FACES = 2_000_000


def foreign(key: str) -> str:
    """Return the format of a mesh by its key in `Source.assets`; "" if MuJoCo reads it."""
    return next((suffix for suffix in FOREIGN if key.endswith(f"{suffix}.obj")), "")


def convert(assets: dict[str, bytes], failed: Callable[[str, str], object]) -> None:
    """Convert all meshes that MuJoCo cannot read, in place.

    failed: called with the key and the reason for each mesh that cannot be read; it becomes empty.
    """
    for key in [key for key in assets if foreign(key)]:
        try:
            assets[key] = converted(assets[key], foreign(key))
        except MemoryError:
            raise
        except Exception as error:  # of four readers of other projects, for damaged files
            assets[key] = b""
            failed(key, " ".join(f"{type(error).__name__}: {error}".split())[:160])


def converted(data: bytes, suffix: str) -> bytes:
    """Return a mesh as the text of an OBJ file, in m; the parts of a scene become one.

    The unit of a COLLADA file counts, its up axis does not: a link has the axes of its mesh, as in
    robot viewers.

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
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    text = export_obj(plain, include_normals=False, include_color=False, include_texture=False)
    return str(text).encode()


def _check(parts: "Sequence[trimesh.Trimesh]") -> None:
    faces = sum(len(part.faces) for part in parts)
    if not 0 < faces <= MOST_FACES:
        raise ValueError(f"{faces} triangles; 1 to {MOST_FACES} are read")
    if not all(math.isfinite(float(abs(part.vertices).max())) for part in parts):
        raise ValueError("a coordinate is not finite")
