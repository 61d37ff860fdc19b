"""The binary part of a GLB: arrays in, accessors out."""

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

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
