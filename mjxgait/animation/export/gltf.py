"""Parts of a GLB file: its binary buffer, additions to a file, and marks on the floor.

Rungs pass with a walk; tiles are moved by a page. Axes are glTF's: Y up, forward +Z.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.clips.glb_document import (
    BINARY,
    CHUNK,
    DESCRIPTION,
    HEADER,
    MAGIC,
    VERSION,
    read_chunks,
)
from mjxgait.animation.export.loop import WalkLoop

KINDS = {
    np.dtype(np.uint8): gltf.UNSIGNED_BYTE,
    np.dtype(np.uint16): gltf.UNSIGNED_SHORT,
    np.dtype(np.uint32): gltf.UNSIGNED_INT,
    np.dtype(np.float32): gltf.FLOAT,
}
SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Buffer:
    """Buffer that collects arrays for a document."""

    def __init__(self, document: gltf.GLTF2) -> None:
        self.document = document
        self.blob = bytearray()

    def add(
        self,
        values: np.ndarray,
        target: int | None = None,
        bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Store an array [n] or [n, width], and return the number of its accessor.

        bounds: state the least and greatest values. normalized: whole numbers stand for 0 to 1.
        """
        values = np.ascontiguousarray(values)
        rows = values.reshape(len(values), -1)
        self.blob += bytes(-len(self.blob) % 4)
        view = gltf.BufferView(
            buffer=0, byteOffset=len(self.blob), byteLength=values.nbytes, target=target
        )
        self.blob += values.tobytes()
        self.document.bufferViews.append(view)
        accessor = gltf.Accessor(
            bufferView=len(self.document.bufferViews) - 1,
            componentType=KINDS[values.dtype],
            count=len(values),
            normalized=normalized,
            type=SHAPES[rows.shape[1]],
        )
        if bounds:
            accessor.min, accessor.max = rows.min(0).tolist(), rows.max(0).tolist()
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1

    def close(self) -> None:
        """Put the bytes into the document."""
        self.blob += bytes(-len(self.blob) % 4)
        self.document.buffers = [gltf.Buffer(byteLength=len(self.blob))]
        self.document.set_binary_blob(bytes(self.blob))


def facts_of(loop: WalkLoop, travelling: bool, units: float = 1.0) -> dict[str, Any]:
    """The facts of a loop that files state. units: of the file, per m."""
    return {
        "strides": loop.strides,
        "speed_m_per_s": units * loop.speed,
        "frames_per_s": loop.rate,
        "travelling": travelling,
    }


def add_channel(
    buffer: Buffer, animation: gltf.Animation, times: int, node: int, path: str, values: np.ndarray
) -> None:
    """Add key frames of a node to an animation.

    times: number of the accessor with their times. path: translation or rotation. values: [F, 3 or
    4].
    """
    target = gltf.AnimationChannelTarget(node=node, path=path)
    sampler, output = len(animation.samplers), buffer.add(values.astype(np.float32))
    animation.channels.append(gltf.AnimationChannel(sampler=sampler, target=target))
    animation.samplers.append(
        gltf.AnimationSampler(input=times, output=output, interpolation="LINEAR")
    )


SAMPLES = ("input", "output")
"""Keys of a sampler that are numbers of accessors."""


def added(data: bytes, buffer: Buffer, nodes: Mapping[int, Mapping[str, Any]]) -> bytes:
    """The bytes of a GLB file with the arrays and animations of a buffer's document at its end.

    The description is edited as JSON, so that whatever the library does not know stays.

    Args:
      data: the file. nodes: keys to write, by the number of the node; None removes a key.

    Raises:
      ValueError, LookupError, TypeError, struct.error: the file is damaged.
    """
    chunks = read_chunks(data)
    whole, blob = json.loads(chunks.pop(DESCRIPTION)), bytearray(chunks.pop(BINARY, b""))
    buffers = whole.setdefault("buffers", [])
    if sum(each["byteLength"] for each in buffers[:1]) > len(blob):
        raise ValueError("its binary part is too short")
    blob += bytes(-len(blob) % 4)
    more = json.loads(buffer.document.to_json())
    views, arrays = (whole.setdefault(key, []) for key in ("bufferViews", "accessors"))
    for animation in more["animations"]:
        for sampler in animation["samplers"]:
            sampler |= {key: sampler[key] + len(arrays) for key in SAMPLES}
    for array in more["accessors"]:
        array["bufferView"] += len(views)
    for view in more["bufferViews"]:
        view["byteOffset"] += len(blob)
    views += more["bufferViews"]
    arrays += more["accessors"]
    whole.setdefault("animations", []).extend(more["animations"])
    blob += buffer.blob
    whole["buffers"] = [{**(buffers or [{}])[0], "byteLength": len(blob)}, *buffers[1:]]
    for number, change in nodes.items():
        merged = whole["nodes"][number] | change
        whole["nodes"][number] = {key: value for key, value in merged.items() if value is not None}
    text = json.dumps(whole, separators=(",", ":")).encode()
    return joined({DESCRIPTION: text, BINARY: bytes(blob)} | chunks)


def joined(chunks: Mapping[bytes, bytes]) -> bytes:
    """Return a file of chunks, each filled up to whole words: JSON with blanks."""
    parts = []
    for kind, content in chunks.items():
        filled = content + (b" " if kind == DESCRIPTION else b"\0") * (-len(content) % 4)
        parts.append(CHUNK.pack(len(filled), kind) + filled)
    body = b"".join(parts)
    return HEADER.pack(MAGIC, VERSION, HEADER.size + len(body)) + body


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
        _animate(document, buffer, node, path, keys, values)


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
