"""The user's character: a GLB or FBX file, its tree of nodes at rest, and the bones of its skin.

Letters: `N` nodes of the file.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import read_bytes, written
from mjxgait.animation.clips.fbx import opened
from mjxgait.animation.clips.glb_document import DAMAGED, Document, Part, damaged, open_glb
from mjxgait.animation.clips.read_glb import name_of, placed, skin_of, worlds
from mjxgait.errors import UserError


@dataclasses.dataclass(frozen=True, eq=False)
class Character:
    """A GLB file and its nodes; an FBX file as the GLB that Blender makes of it.

    path: of the user's file. data: bytes of the GLB. document: its description. parents: [N] -1 for
    none. order: [N] parents first. local, world: [N, 4, 4] at rest against the parent, and in the
    scene. bones: nodes by name, those of the largest skin. clips: names of the animations.
    """

    path: Path
    data: bytes
    document: Document
    parents: tuple[int, ...]
    order: tuple[int, ...]
    local: np.ndarray
    world: np.ndarray
    bones: Mapping[str, tuple[int, ...]]
    clips: frozenset[str]

    @property
    def nodes(self) -> Sequence[Part]:
        """The nodes [N]."""
        found: Sequence[Part] = self.document.nodes
        return found

    def above(self, node: int) -> list[int]:
        """The nodes above a node, from its parent on."""
        found = []
        while (node := self.parents[node]) >= 0:
            found.append(node)
        return found

    def split(self, node: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Translation [3], quaternion [4] and scale [3] of a node at rest, which has no shear."""
        place, axes = self.local[node, :3, 3], self.local[node, :3, :3]
        size = np.linalg.norm(axes, axis=0) * [np.sign(np.linalg.det(axes)), 1.0, 1.0]
        if not self.nodes[node].matrix:  # which may have other signs
            size = np.array(self.nodes[node].scale or [1.0, 1.0, 1.0], float)
        return place, Rotation.from_matrix(axes / size).as_quat(), size


def read_character(path: Path) -> Character:
    """Return the bones of a file.

    Raises:
      UserError: it is no GLB or FBX, is damaged, or has no skin; FBX takes a Blender.
    """
    with opened(path) as file:
        return dataclasses.replace(_read(file), path=path)


def _read(path: Path) -> Character:
    document = open_glb(path)
    nodes = document.nodes
    try:
        parents, order, world = worlds(path, nodes)
        local = np.array([placed(node) for node in nodes])
        bones: dict[str, tuple[int, ...]] = {}
        for joint in document.skins[skin_of(path, document)].joints:
            name = written(name_of(nodes, joint))
            bones[name] = (*bones.get(name, ()), joint)
        clips = frozenset(str(animation.name) for animation in document.animations)
    except DAMAGED as error:
        raise damaged(path) from error
    if not np.isfinite(world).all():
        raise UserError(f"{path}: the place of a node is not a finite number; export it again")
    tree = tuple(parents), tuple(order)
    return Character(path, read_bytes(path), document, *tree, local, world, bones, clips)
