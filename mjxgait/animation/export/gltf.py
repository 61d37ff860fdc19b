"""Parts of a GLB file: its binary buffer, key frames, and additions to an existing file."""

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


def add_channel(
    buffer: Buffer, animation: gltf.Animation, times: int, node: int, path: str, values: np.ndarray
) -> None:
    """Add key frames of a node to an animation.

    times: number of the accessor with their times. path: translation, rotation or scale. values:
    [F, 3 or 4].
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
