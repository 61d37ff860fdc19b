"""Read a GLB file: its tree of nodes, its animation, and its skinned skeleton at rest.

Such files come from strangers, so each defect is a one-sentence error.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]
from scipy.spatial.transform import Rotation, Slerp

from mjxgait.animation.clips.clip import (
    NOTE,
    Clip,
    Rig,
    check_numbers,
    check_size,
    check_times,
)
from mjxgait.animation.clips.glb_document import DAMAGED, Document, Part, damaged, open_glb
from mjxgait.errors import UserError

TYPES = {
    gltf.BYTE: np.int8,
    gltf.UNSIGNED_BYTE: np.uint8,
    gltf.SHORT: np.int16,
    gltf.UNSIGNED_SHORT: np.uint16,
    gltf.FLOAT: np.float32,
}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def tree(path: Path, nodes: Sequence[Part]) -> tuple[list[int], list[int]]:
    """Parent of each node, -1 for none, and an order with parents first."""
    parents = [-1] * len(nodes)
    for i, node in enumerate(nodes):
        for child in node.children or []:
            parents[child] = i
    order = [i for i, parent in enumerate(parents) if parent < 0]
    for place in order:
        order += [child for child in nodes[place].children or [] if parents[child] == place]
    if len(order) != len(nodes):
        raise UserError(f"{path}: its nodes are no tree")
    return parents, order


def name_of(nodes: Sequence[Part], node: int) -> str:
    """A node's name, or one made of its number."""
    name = nodes[node].name
    return f"node {node}" if name is None else str(name)


def placed(node: Part) -> np.ndarray:
    """Transform [4, 4] of a node at rest against its parent."""
    if node.matrix:
        return np.array(node.matrix, float).reshape(4, 4).T
    whole = np.eye(4)
    turned = Rotation.from_quat(np.array(node.rotation or [0, 0, 0, 1], float))
    whole[:3, :3] = turned.as_matrix() * np.array(node.scale or [1, 1, 1], float)
    whole[:3, 3] = np.array(node.translation or [0, 0, 0], float)
    return whole


def values(document: Document, number: int, every: int = 1) -> np.ndarray:
    """Stored values [n, width] of an accessor. every: take one in this many."""
    accessor = document.accessors[number]
    if accessor.bufferView is None or accessor.sparse:
        raise ValueError("an accessor without plain values")
    view, blob = document.bufferViews[accessor.bufferView], document.blob
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


RATE = 60
"""Frames/s for an animation with keys at different times for different bones."""


def read_glb(path: Path) -> Clip:
    """Return the first animation of a file, with all nodes.

    Raises:
      UserError: it is no GLB, is damaged, or has no animation that turns anything.
    """
    document = open_glb(path)
    nodes = document.nodes
    try:
        parents, order = tree(path, nodes)
        rest = np.array([_turn(node) for node in nodes])
        keys = _keys(path, document)
        names = tuple(name_of(nodes, i) for i in range(len(nodes)))
        note = _note(nodes)
    except DAMAGED as error:
        raise damaged(path) from error
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
    turned = world @ still.transpose(0, 2, 1)
    return Clip(names, tuple(parents), times - times[0], turned, note)


def _turn(node: Part) -> np.ndarray:
    """Rotation [3, 3] of a node at rest; a mirrored node is turned as its mirror image."""
    if not node.matrix:
        return Rotation.from_quat(node.rotation or [0.0, 0.0, 0.0, 1.0]).as_matrix()
    columns = placed(node)[:3, :3]
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    columns[:, 0] *= np.sign(np.linalg.det(columns)) or 1.0
    return Rotation.from_matrix(columns).as_matrix()


def _note(nodes: Sequence[Part]) -> str:
    """The note of an exported walk, found on one of its nodes; else empty."""
    notes = (getattr(node.extras, NOTE, None) for node in nodes)
    return next((note for note in notes if isinstance(note, str)), "")


def _keys(path: Path, document: Document) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Times [n] s and quaternions [n, 4] (x, y, z, w) of each node that turns."""
    found: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for animation in document.animations[:1]:
        for channel in animation.channels:
            target = channel.target
            if target.path != "rotation" or target.node is None:
                continue
            sampler = animation.samplers[channel.sampler]
            check_size(path, 1, max(document.accessors[sampler.input].count, 2))
            times = shares(values(document, sampler.input))[:, 0]
            quats = shares(values(document, sampler.output))
            if sampler.interpolation == "CUBICSPLINE":
                quats = quats.reshape(len(times), 3, 4)[:, 1]  # between tangents
            name = name_of(document.nodes, target.node)
            check_numbers(path, f'the rotation of "{name}"', quats)
            if len(quats) != len(times) or quats.shape[1] != 4 or not quats.any(1).all():
                raise ValueError("keys and times do not fit")
            check_times(path, times)
            found[target.node] = times, quats
    return found


def _common_times(path: Path, keys: dict[int, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Times [F] of the keys if all bones share them, else evenly spaced over all."""
    every = [times for times, _ in keys.values()]
    longest = max(every, key=len)
    if all(np.array_equal(times, longest) or len(times) == 1 for times in every):
        return longest
    first, last = min(times[0] for times in every), max(times[-1] for times in every)
    count = round((last - first) * RATE) + 1
    check_size(path, 1, count)
    return np.linspace(first, last, count)


def _sampled(at: np.ndarray, quats: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Rotations [F, 3, 3] at other times, on the shortest path between keys."""
    turns = Rotation.from_quat(quats)
    if len(at) == 1:
        return np.tile(turns.as_matrix()[0], (len(times), 1, 1))
    return Slerp(at, turns)(np.clip(times, at[0], at[-1])).as_matrix()


ENOUGH = 50_000
"""Approximate number of vertices read from one mesh; of a larger mesh only every n-th."""


def rig_of_glb(path: Path) -> Rig:
    """Return the bones of a file's largest skin.

    Raises:
      UserError: it is no GLB, is damaged, or has no skin.
    """
    document = open_glb(path)
    try:
        return _rig(path, document, skin_of(path, document))
    except DAMAGED as error:
        raise damaged(path) from error


def skin_of(path: Path, document: Document) -> int:
    """Return the number of the skin with the most bones.

    Raises:
      UserError: there is none.
    """
    if not document.skins:
        raise UserError(
            f"{path}: has no skin, which says what its bones are; export the armature with its "
            "mesh, or as BVH"
        )
    return max(range(len(document.skins)), key=lambda s: len(document.skins[s].joints))


def worlds(path: Path, nodes: Sequence[Part]) -> tuple[list[int], list[int], np.ndarray]:
    """Parents and order of the nodes, see `tree`, and their transforms [N, 4, 4] at rest."""
    parents, order = tree(path, nodes)
    world = np.zeros((len(nodes), 4, 4))
    for node in order:
        above = np.eye(4) if parents[node] < 0 else world[parents[node]]
        world[node] = above @ placed(nodes[node])
    return parents, order, world


def _rig(path: Path, document: Document, number: int) -> Rig:
    nodes = document.nodes
    parents, order, world = worlds(path, nodes)
    skins = _skins(document, number, world)
    joints = {int(joint) for joint in document.skins[number].joints}
    whole = Rig(
        tuple(name_of(nodes, node) for node in order),
        tuple(order.index(parents[node]) if parents[node] >= 0 else -1 for node in order),
        world[order, :3, 3],
        (np.zeros((0, 3)),) * len(order),
        tuple(skins.get(node, np.zeros((0, 3))) for node in order),
        metres=1.0,
    )
    return whole.taken([i for i, node in enumerate(order) if node in joints])


def _skins(document: Document, number: int, world: np.ndarray) -> Mapping[int, np.ndarray]:
    """Vertices [V, 3] that follow each joint most, placed as in the skeleton at rest."""
    skin = document.skins[number]
    joints = np.array(skin.joints, int)
    bound = world[joints]
    if skin.inverseBindMatrices is not None:
        stored = values(document, skin.inverseBindMatrices).reshape(-1, 4, 4)
        bound = bound @ stored.transpose(0, 2, 1)
    points, followed = [np.zeros((0, 3))], [np.zeros(0, int)]
    meshes = {node.mesh for node in document.nodes if node.skin == number and node.mesh is not None}
    for primitive in (part for mesh in meshes for part in document.meshes[mesh].primitives):
        parts = primitive.attributes
        if parts.JOINTS_0 is None or parts.WEIGHTS_0 is None or parts.POSITION is None:
            continue
        every = 1 + document.accessors[parts.POSITION].count // ENOUGH
        places, named, weights = (
            values(document, stored, every)
            for stored in (parts.POSITION, parts.JOINTS_0, parts.WEIGHTS_0)
        )
        if document.accessors[parts.POSITION].normalized:
            places = shares(places)
        most = shares(weights).argmax(1)
        main = named[np.arange(len(named)), most].astype(int)
        spots = np.concatenate([places.astype(float), np.ones((len(places), 1))], 1)
        points.append((bound[main] @ spots[..., None])[:, :3, 0])
        followed.append(joints[main])
    every_point, leader = np.concatenate(points), np.concatenate(followed)
    return {int(joint): every_point[leader == joint] for joint in joints}
