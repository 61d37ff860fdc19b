"""Rungs on the floor that pass below a creature that walks in place, so that one sees it move.

glTF's axes: Y up, forward +Z.
"""

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.buffer import Buffer
from mjxgait.animation.loop import WalkLoop

APART, DEEP, WIDE = 0.35, 0.06, 0.9
"""Body lengths between rungs, about; of a rung along the way, as a share of that; half across."""
REACH = 1.6
"""Body lengths before and behind the creature."""
JUMP = 1e-4
"""s in which the rungs go back by one place, where nobody sees it."""
COLOUR = (0.45, 0.46, 0.48, 1.0)


def add_floor(document: gltf.GLTF2, buffer: Buffer, loop: WalkLoop) -> None:
    """Adds the rungs to the scene and their motion to its animation.

    A loop leads over a whole number of rungs, each of which takes the place of the one before; the
    foremost grows and the last vanishes, so that there is no seam. Who stays in place has none.
    """
    length = loop.walk.creature.frame.body_length
    count = round(abs(loop.advance) / (APART * length))
    if not count:
        return
    apart = loop.advance / count
    around = round(REACH * length / abs(apart))
    mesh = _rung(document, buffer, WIDE * length, DEEP * abs(apart))
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
        _animate(document, buffer, node, path, keys, values)


def _rung(document: gltf.GLTF2, buffer: Buffer, wide: float, deep: float) -> int:
    """The mesh of one rung; half sizes in m."""
    corners = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], np.float32)
    points = corners * np.array([wide, 0.0, deep], np.float32)
    up = np.tile(np.array([0.0, 1.0, 0.0], np.float32), (4, 1))
    faces = np.array([0, 1, 2, 0, 2, 3], np.uint16)
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
    document.meshes.append(gltf.Mesh(name="rung", primitives=[primitive]))
    return len(document.meshes) - 1


def _animate(
    document: gltf.GLTF2, buffer: Buffer, node: int, path: str, keys: int, values: np.ndarray
) -> None:
    animation = document.animations[0]
    target = gltf.AnimationChannelTarget(node=node, path=path)
    animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers), target=target))
    output = buffer.add(values.astype(np.float32))
    animation.samplers.append(
        gltf.AnimationSampler(input=keys, output=output, interpolation="LINEAR")
    )
