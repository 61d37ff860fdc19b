"""How low the skin of a character's feet is, vertex by vertex, by linear blend skinning.

Letters: `V` vertices, `K` bones that a vertex follows, `N` nodes of the file, `F` key frames.
"""

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np

from mjxgait.animation.clips.glb_document import DAMAGED, Document, Part
from mjxgait.animation.clips.read_glb import shares, values
from mjxgait.animation.export.character import Character

SETS = 2
"""Largest number of sets of four bones that a vertex follows."""
MAIN = 0.5
"""Share of a vertex's weights from which it belongs to a foot."""


@dataclasses.dataclass(frozen=True, eq=False)
class Sole:
    """Vertices of one foot.

    nodes: [V, K] the bones that each vertex follows. spots: [V, K, 4] its place at rest in the axes
    of each, times the bone's share, which is the fourth number.
    """

    nodes: np.ndarray
    spots: np.ndarray

    def lowest(self, world: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Numbers [F] of the vertices that are lowest along `up` [3].

        world: [F, N, 4, 4] transforms of the nodes in the scene.
        """
        rows = np.einsum("i,fnij->fnj", up, world[:, :, :3])
        heights = (np.einsum("vkj,vkj->v", self.spots, row[self.nodes]) for row in rows)
        return np.array([height.argmin() for height in heights])

    def places(self, world: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Places [F, 3] in the scene of one vertex in each frame."""
        moved = world[np.arange(len(world))[:, None], self.nodes[which], :3]
        places: np.ndarray = np.einsum("fkij,fkj->fi", moved, self.spots[which])
        return places

    def lows(self, world: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Least height [F] of the vertices along `up`."""
        heights: np.ndarray = self.places(world, self.lowest(world, up)) @ up
        return heights


def soles_of(character: Character, feet: Sequence[Collection[int]]) -> list[Sole | None]:
    """The soles of feet, each given by its bones; None for a foot without skin.

    Meshes that cannot be read, such as those with sparse vertices, do not count.
    """
    parts = list(_parts(character.document))
    return [_sole(parts, feet_nodes) for feet_nodes in feet]


def below(character: Character, nodes: Collection[int]) -> set[int]:
    """Some nodes and all that hang on them."""
    found = set(nodes)
    for node in character.order:
        if character.parents[node] in found:
            found.add(node)
    return found


def _sole(parts: Sequence[Sole], nodes: Collection[int]) -> Sole | None:
    """The vertices of all meshes that mainly follow these nodes."""
    found = []
    for part in parts:
        own = np.where(np.isin(part.nodes, list(nodes)), part.spots[..., 3], 0.0).sum(1) >= MAIN
        if own.any():
            found.append(Sole(part.nodes[own], part.spots[own]))
    if not found:
        return None
    return Sole(np.concatenate([s.nodes for s in found]), np.concatenate([s.spots for s in found]))


def _parts(document: Document) -> list[Sole]:
    """All vertices of each part of each skinned mesh."""
    found = []
    for node in document.nodes:
        if node.skin is None or node.mesh is None:
            continue
        for primitive in document.meshes[node.mesh].primitives:
            try:
                found.append(_skinned(document, document.skins[node.skin], primitive.attributes))
            except DAMAGED:
                continue
    return found


def _skinned(document: Document, skin: Part, parts: Part) -> Sole:
    """Vertices of one part of a mesh; an error if it has no weights."""
    joints = np.array(skin.joints, int)
    bind = np.tile(np.eye(4), (len(joints), 1, 1))
    if skin.inverseBindMatrices is not None:
        bind = values(document, skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    stored = values(document, parts.POSITION)
    whole = document.accessors[parts.POSITION].normalized
    places = np.insert(shares(stored) if whole else stored.astype(float), 3, 1.0, axis=1)
    sets = [i for i in range(SETS) if getattr(parts, f"JOINTS_{i}") is not None]
    named, weights = (
        np.concatenate([values(document, getattr(parts, f"{key}_{i}")) for i in sets], 1)
        for key in ("JOINTS", "WEIGHTS")
    )
    weights = shares(weights)
    follows = weights.sum(1) > 0
    named, weights, places = named[follows].astype(int), weights[follows], places[follows]
    weights /= weights.sum(1, keepdims=True)
    own = np.einsum("vkij,vj->vki", bind[named], places)
    return Sole(joints[named], weights[..., None] * own)
