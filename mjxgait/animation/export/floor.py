"""Marks on the floor of a GLB file: rungs pass with a walk, a page moves tiles.

Axes are glTF's: Y up, forward +Z.
"""

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.export.gltf import Buffer, add_channel
from mjxgait.animation.export.loop import WalkLoop

APART, DEEP, WIDE = 0.35, 0.06, 0.9
"""Approximate distance of rungs in body lengths.

Half size of a rung along the way as a share of it, and across in body lengths.
"""
REACH = 1.6
"""Reach of the rungs before and behind the creature in body lengths."""
TILES_APART, TILES_REACH, TILE = 0.5, 6.0, 0.1
"""Distance of tiles and radius of the patch in body lengths.

Half size of a tile as a share of the distance.
"""
JUMP = 1e-4
"""Time in s in which the rungs jump back by one place, too short to be seen."""
COLOUR = (0.45, 0.46, 0.48, 1.0)


def add_floor(document: gltf.GLTF2, buffer: Buffer, loop: WalkLoop) -> None:
    """Add the rungs to the scene and their motion to its animation.

    A loop passes a whole number of rungs; each takes the place of the one before. The foremost
    grows and the last vanishes, so that there is no seam. A creature that stays in place gets no
    rungs.
    """
    length = loop.walk.creature.frame.body_length
    count = round(abs(loop.advance) / (APART * length))
    if not count:
        return
    apart = loop.advance / count
    around = round(REACH * length / abs(apart))
    size = (WIDE * length, DEEP * abs(apart))
    mesh = _flat(document, buffer, "rung", np.zeros((1, 2)), size)
    places = range(-around, around + 1)
    first = len(document.nodes)
    document.nodes += [gltf.Node(mesh=mesh, translation=[0.0, 0.0, i * apart]) for i in places]
    children = list(range(first, len(document.nodes)))
    document.nodes.append(gltf.Node(name="floor", children=children))
    document.scenes[0].nodes.append(len(document.nodes) - 1)
    period = loop.times[-1] / count
    begins = np.arange(count) * period
    times = np.stack([begins, begins + period - JUMP * (begins + period < loop.times[-1])], 1)
    share = np.tile([0.0, 1.0], count)[:, None]
    keys = buffer.add(times.ravel().astype(np.float32), bounds=True)
    for node, path, values in (
        (children[-1] + 1, "translation", share * [0.0, 0.0, -apart]),
        (children[-1], "scale", share * [1.0, 0.0, 0.0] + [0.0, 1.0, 1.0]),
        (children[0], "scale", share * [-1.0, 0.0, 0.0] + [1.0, 1.0, 1.0]),
    ):
        add_channel(buffer, document.animations[0], keys, node, path, values)


def add_tiles(document: gltf.GLTF2, buffer: Buffer, length: float) -> float:
    """Add a round patch of tiles as the node "floor", without motion.

    length: m of the body. Returns the distance of neighbours in m: moved by it to any side, the
    patch looks the same.
    """
    apart, around = TILES_APART * length, round(TILES_REACH / TILES_APART)
    places = np.arange(-around, around + 1)
    lattice = np.stack(np.meshgrid(places, places), -1).reshape(-1, 2)
    centres = apart * lattice[np.linalg.norm(lattice, axis=1) <= around]
    mesh = _flat(document, buffer, "tiles", centres, (TILE * apart, TILE * apart))
    document.nodes.append(gltf.Node(name="floor", mesh=mesh))
    document.scenes[0].nodes.append(len(document.nodes) - 1)
    return float(apart)


def _flat(
    document: gltf.GLTF2, buffer: Buffer, name: str, centres: np.ndarray, half: tuple[float, float]
) -> int:
    """Number of a new mesh of rectangles about centres [N, 2]; m to the left and ahead.

    half: half sizes in m.
    """
    corners = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) * half
    flat = (centres[:, None] + corners).reshape(-1, 2)
    points = np.stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]], -1).astype(np.float32)
    up = np.tile(np.array([0.0, 1.0, 0.0], np.float32), (len(points), 1))
    faces = (4 * np.arange(len(centres))[:, None] + [0, 1, 2, 0, 2, 3]).ravel().astype(np.uint16)
    look = gltf.PbrMetallicRoughness(
        baseColorFactor=[*COLOUR], metallicFactor=0.0, roughnessFactor=1.0
    )
    document.materials.append(gltf.Material(name="floor", pbrMetallicRoughness=look))
    primitive = gltf.Primitive(
        attributes=gltf.Attributes(
            POSITION=buffer.add(points, gltf.ARRAY_BUFFER, bounds=True),
            NORMAL=buffer.add(up, gltf.ARRAY_BUFFER),
        ),
        indices=buffer.add(faces, gltf.ELEMENT_ARRAY_BUFFER),
        material=len(document.materials) - 1,
    )
    document.meshes.append(gltf.Mesh(name=name, primitives=[primitive]))
    return len(document.meshes) - 1
