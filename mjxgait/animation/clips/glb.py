"""Content of a GLB file, through pygltflib: its description, its tree of nodes, its numbers.

Such files come from strangers, so every failure of the library becomes a one-sentence error.
"""

import json
import struct
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import check_size, read_bytes
from mjxgait.errors import UserError

MAGIC, HEAD = b"glTF", 20
"""First bytes of a file; number of bytes before its description, which comes first."""
MOST_PARTS = 30_000
"""Largest number of accessors, channels and the like; the library reads them one by one."""
TYPES = {
    gltf.BYTE: np.int8,
    gltf.UNSIGNED_BYTE: np.uint8,
    gltf.SHORT: np.int16,
    gltf.UNSIGNED_SHORT: np.uint16,
    gltf.FLOAT: np.float32,
}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
DAMAGED = (
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
    struct.error,
)
"""Errors raised while reading content that does not follow its format."""


def open_glb(path: Path) -> gltf.GLTF2:
    """Return a file's description with its binary part.

    Raises:
      UserError: it is no GLB, is cut off, damaged, or has more bones than one creature.
    """
    data = read_bytes(path)
    if len(data) < HEAD or data[:4] != MAGIC:
        raise UserError(f"{path}: not a GLB file; export as glTF binary (.glb)")
    if struct.unpack_from("<I", data, 8)[0] > len(data):
        raise UserError(f"{path}: is cut off: it states more bytes than it has")
    try:
        _check_parts(path, data[HEAD : HEAD + struct.unpack_from("<I", data, 12)[0]])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about versions and parts that it does not know
            document = gltf.GLTF2.load_from_bytes(data)
        if any(buffer.uri for buffer in document.buffers):
            raise UserError(f"{path}: refers to another file; export as one GLB")
    except DAMAGED:
        raise UserError(f"{path}: its description is damaged") from None
    return document


def _check_parts(path: Path, description: bytes) -> None:
    """Refuse files that would take the library minutes."""
    lists = json.loads(description)
    if not isinstance(lists.get("nodes", []), list):
        raise UserError(f"{path}: its list of nodes is damaged")
    check_size(path, len(lists.get("nodes", [])), 2)
    if description.count(b"{") > MOST_PARTS:
        raise UserError(f"{path}: of more than {MOST_PARTS} parts; export one creature, one clip")


def tree(path: Path, nodes: Sequence[gltf.Node]) -> tuple[list[int], list[int]]:
    """Parent of each node, -1 for none, and an order with parents first."""
    parents = [-1] * len(nodes)
    for i, node in enumerate(nodes):
        for child in node.children or []:
            parents[child] = i
    order = [i for i, parent in enumerate(parents) if parent < 0]
    for node in order:
        order += [child for child in nodes[node].children or [] if parents[child] == node]
    if len(order) != len(nodes):
        raise UserError(f"{path}: its nodes are no tree")
    return parents, order


def name_of(nodes: Sequence[gltf.Node], node: int) -> str:
    """A node's name, or one made of its number."""
    name = nodes[node].name
    return f"node {node}" if name is None else str(name)


def placed(node: gltf.Node) -> np.ndarray:
    """Transform [4, 4] of a node at rest against its parent."""
    if node.matrix:
        return np.array(node.matrix, float).reshape(4, 4).T
    whole = np.eye(4)
    turned = Rotation.from_quat(np.array(node.rotation or [0, 0, 0, 1], float))
    whole[:3, :3] = turned.as_matrix() * np.array(node.scale or [1, 1, 1], float)
    whole[:3, 3] = np.array(node.translation or [0, 0, 0], float)
    return whole


def values(document: gltf.GLTF2, number: int, every: int = 1) -> np.ndarray:
    """Stored values [n, width] of an accessor. every: take one in this many."""
    accessor = document.accessors[number]
    if accessor.bufferView is None or accessor.sparse:
        raise ValueError("an accessor without plain values")
    view, blob = document.bufferViews[accessor.bufferView], document.binary_blob() or b""
    kind, width = np.dtype(TYPES[accessor.componentType]), WIDTHS[accessor.type]
    start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    stride, count = view.byteStride or width * kind.itemsize, accessor.count
    end = start + (count - 1) * stride + width * kind.itemsize
    if view.buffer or start < 0 or stride < 1 or count < 1 or end > len(blob):
        raise ValueError("an accessor beyond the end of the file")
    return np.ndarray((count, width), kind, blob, start, (stride, kind.itemsize))[::every]


def shares(stored: np.ndarray) -> np.ndarray:
    """Stored values as floats; whole numbers stand for -1 to 1, or 0 to 1."""
    if stored.dtype.kind == "f":
        return stored.astype(float)
    return stored.astype(float) / np.iinfo(stored.dtype).max
