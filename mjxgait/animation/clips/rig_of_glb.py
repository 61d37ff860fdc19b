"""Read the skeleton of a skinned GLB file: rest places of its bones, and the vertices they move."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.clips.glb import (
    DAMAGED,
    name_of,
    open_glb,
    placed,
    shares,
    tree,
    values,
)
from mjxgait.animation.clips.rig import Rig
from mjxgait.errors import UserError

ENOUGH = 50_000
"""Approximate number of vertices read from one mesh; of a larger mesh only every n-th."""


def rig_of_glb(path: Path) -> Rig:
    """Return the bones of a file's largest skin.

    Raises:
      UserError: it is no GLB, is damaged, or has no skin.
    """
    document = open_glb(path)
    if not document.skins:
        raise UserError(
            f"{path}: has no skin, which says what its bones are; export the armature with its "
            "mesh, or as BVH"
        )
    try:
        number = max(range(len(document.skins)), key=lambda s: len(document.skins[s].joints))
        return _rig(path, document, number)
    except DAMAGED as error:
        raise UserError(f"{path}: its content is damaged ({error!r})") from None


def _rig(path: Path, document: gltf.GLTF2, number: int) -> Rig:
    nodes = document.nodes
    parents, order = tree(path, nodes)
    world = np.zeros((len(nodes), 4, 4))
    for node in order:
        above = np.eye(4) if parents[node] < 0 else world[parents[node]]
        world[node] = above @ placed(nodes[node])
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


def _skins(document: gltf.GLTF2, number: int, world: np.ndarray) -> Mapping[int, np.ndarray]:
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
        most = shares(weights).argmax(1)
        main = named[np.arange(len(named)), most].astype(int)
        spots = np.concatenate([places.astype(float), np.ones((len(places), 1))], 1)
        points.append((bound[main] @ spots[..., None])[:, :3, 0])
        followed.append(joints[main])
    every_point, who = np.concatenate(points), np.concatenate(followed)
    return {int(joint): every_point[who == joint] for joint in joints}
