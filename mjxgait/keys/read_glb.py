"""Reads the animation of a GLB file: nodes, their rest, and the keys of their rotations."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from mjxgait.errors import UserError
from mjxgait.keys.clip import Clip, check_numbers, check_size, check_times, read_bytes
from mjxgait.keys.own import NOTE

MAGIC, JSON, BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
TYPES = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5126: np.float32,
}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
RATE = 60
"""Frames/s of an animation whose bones have keys at different times."""
DAMAGED = (
    KeyError,
    IndexError,
    TypeError,
    ValueError,
    AttributeError,
    struct.error,
    RecursionError,
)


def read_glb(path: Path) -> Clip:
    """The first animation of a file, of all its nodes.

    Raises:
      UserError: it is no GLB, is damaged, or has no animation that turns anything.
    """
    document, blob = _chunks(path, read_bytes(path))
    nodes = document.get("nodes", [])
    if not isinstance(nodes, list):
        raise UserError(f"{path}: its list of nodes is damaged")
    check_size(path, len(nodes), 2)
    try:
        parents, order = _tree(path, nodes)
        rest = np.array([_rest(node) for node in nodes])
        keys = _keys(path, document, blob)
    except UserError:
        raise
    except DAMAGED as error:
        raise UserError(f"{path}: its content is damaged ({error!r})") from None
    if not keys:
        raise UserError(f"{path}: has no animation that turns a bone; export with animations")
    times = _common_times(path, keys)
    check_size(path, len(nodes), len(times))
    local = np.tile(rest, (len(times), 1, 1, 1))
    for node, (at, quats) in keys.items():
        local[:, node] = _sampled(at, quats, times)
    world, still = np.empty_like(local), np.empty_like(rest)
    for node in order:
        above = parents[node]
        world[:, node] = local[:, node] if above < 0 else world[:, above] @ local[:, node]
        still[node] = rest[node] if above < 0 else still[above] @ rest[node]
    names = tuple(str(node.get("name", f"node {i}")) for i, node in enumerate(nodes))
    turned = world @ still.transpose(0, 2, 1)
    return Clip(names, tuple(parents), times - times[0], turned, _note(nodes))


def _chunks(path: Path, data: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON document and the binary chunk."""
    if len(data) < 20 or struct.unpack_from("<I", data)[0] != MAGIC:
        raise UserError(f"{path}: not a GLB file; export as glTF binary (.glb)")
    if struct.unpack_from("<I", data, 8)[0] > len(data):
        raise UserError(f"{path}: is cut off: it states more bytes than it has")
    chunks, at = {}, 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        chunks[kind] = data[at + 8 : at + 8 + length]
        at += 8 + length
    try:
        document = json.loads(chunks[JSON])
    except (KeyError, ValueError, RecursionError):
        raise UserError(f"{path}: its description is damaged") from None
    if not isinstance(document, dict):
        raise UserError(f"{path}: its description is damaged")
    return document, chunks.get(BIN, b"")


def _tree(path: Path, nodes: list[Any]) -> tuple[list[int], list[int]]:
    """Parent of each node, -1 for none, and an order with parents first."""
    parents = [-1] * len(nodes)
    for i, node in enumerate(nodes):
        for child in node.get("children", []):
            parents[child] = i
    order = [i for i, parent in enumerate(parents) if parent < 0]
    for node in order:
        order += [child for child in nodes[node].get("children", []) if parents[child] == node]
    if len(order) != len(nodes):
        raise UserError(f"{path}: its nodes are no tree")
    return parents, order


def _rest(node: dict[str, Any]) -> np.ndarray:
    """[3, 3] of a node as the file has it at rest."""
    if "matrix" in node:
        columns = np.array(node["matrix"], float).reshape(4, 4).T[:3, :3]
        return Rotation.from_matrix(columns / np.linalg.norm(columns, axis=0)).as_matrix()
    return Rotation.from_quat(np.array(node.get("rotation", [0, 0, 0, 1]), float)).as_matrix()


def _note(nodes: list[dict[str, Any]]) -> str:
    """The text that an exported walk has on one of its nodes."""
    extras = (node.get("extras") for node in nodes)
    notes = (extra.get(NOTE) for extra in extras if isinstance(extra, dict))
    return next((note for note in notes if isinstance(note, str)), "")


def _keys(
    path: Path, document: dict[str, Any], blob: bytes
) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Times [n] s and quaternions [n, 4] (x, y, z, w) of each node that turns."""
    found: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for animation in document.get("animations", [])[:1]:
        for channel in animation["channels"]:
            target = channel["target"]
            if target.get("path") != "rotation" or "node" not in target:
                continue
            sampler = animation["samplers"][channel["sampler"]]
            times = _accessor(path, document, blob, sampler["input"])[:, 0]
            quats = _accessor(path, document, blob, sampler["output"])
            if sampler.get("interpolation") == "CUBICSPLINE":
                quats = quats.reshape(len(times), 3, 4)[:, 1]  # between tangents
            check_numbers(
                path, f'the rotation of "{document["nodes"][target["node"]]["name"]}"', quats
            )
            if len(quats) != len(times) or quats.shape[1] != 4 or not quats.any(1).all():
                raise ValueError("keys and times do not fit")
            check_times(path, times)
            found[int(target["node"])] = times, quats
    return found


def _accessor(path: Path, document: dict[str, Any], blob: bytes, number: int) -> np.ndarray:
    """The values [n, width] of an accessor, as floats."""
    accessor = document["accessors"][number]
    check_size(path, 1, int(accessor["count"]) // 3)
    if "bufferView" not in accessor or "sparse" in accessor:
        raise ValueError("an accessor without plain values")
    view = document["bufferViews"][accessor["bufferView"]]
    if view.get("buffer", 0) != 0 or "uri" in document["buffers"][0]:
        raise UserError(f"{path}: refers to another file; export as one GLB")
    kind, width = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", 0) or width * kind.itemsize
    count = int(accessor["count"])
    if start < 0 or count < 1 or start + (count - 1) * stride + width * kind.itemsize > len(blob):
        raise ValueError("an accessor beyond the end of the file")
    values = np.ndarray((count, width), kind, blob, start, (stride, kind.itemsize)).astype(float)
    most = {1: 127.0, 2: 32767.0} if kind.kind == "i" else {1: 255.0, 2: 65535.0}
    return values if kind.kind == "f" else values / most[kind.itemsize]


def _common_times(path: Path, keys: dict[int, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The times [F] of the keys where all bones share them, else evenly over all."""
    every = [times for times, _ in keys.values()]
    longest = max(every, key=len)
    if all(np.array_equal(times, longest) or len(times) == 1 for times in every):
        return longest
    first, last = min(times[0] for times in every), max(times[-1] for times in every)
    count = round((last - first) * RATE) + 1
    check_size(path, 1, count)
    return np.linspace(first, last, count)


def _sampled(at: np.ndarray, quats: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Rotations [F, 3, 3] at other times, on the shortest way between keys."""
    turns = Rotation.from_quat(quats)
    if len(at) == 1:
        return np.tile(turns.as_matrix()[0], (len(times), 1, 1))
    return Slerp(at, turns)(np.clip(times, at[0], at[-1])).as_matrix()
