"""A walk as a BVH file: a skeleton in the creature's rest pose, and each bone's angles.

BVH has Y up; here forward is +Z, left +X, lengths are m. Letters: `F` key frames.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mjxgait.animation.export.loop import WalkLoop
from mjxgait.animation.export.skeleton import (
    STILL,
    gltf_axes,
    resting,
    skeleton_of,
    walked,
    world_poses,
)
from mjxgait.animation.export.surface import far_end
from mjxgait.files import write_text, writing

ORDER = "ZXY"
"""Order of a bone's angles, as most programs write them."""


def export_bvh(loop: WalkLoop, path: Path, travelling: bool = False) -> None:
    """Write the loop; see `build_bvh`.

    Raises:
      UserError: the file cannot be written.
    """
    with writing(path):
        write_text(path, build_bvh(loop, travelling))


@dataclasses.dataclass(frozen=True, eq=False)
class Bone:
    """A bone of the file.

    parent: its place, 0 for none. offset: [3] m from the parent in the rest pose. channels: names
    of the columns [F, n]. end: [3] m from the bone's start to its farthest point.
    """

    name: str
    parent: int
    offset: np.ndarray
    channels: list[str]
    columns: np.ndarray
    end: np.ndarray


def build_bvh(loop: WalkLoop, travelling: bool = False) -> str:
    """The text of the file.

    travelling: the trunk moves on at an even speed, in a circle if the walk turns; otherwise the
    creature walks in place.
    """
    bones = _bones(loop, travelling)
    order: list[int] = []
    hierarchy = _branch(bones, 1, order)
    values = np.concatenate([bones[bone].columns for bone in order], 1)
    frames = ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1 / loop.rate:.8f}"]
    return "\n".join(["HIERARCHY", *hierarchy, *frames, *map(_text, values)]) + "\n"


def _bones(loop: WalkLoop, travelling: bool) -> dict[int, Bone]:
    """Bones by place in the skeleton; the trunk's place is 1."""
    model, rest_qpos = loop.walk.creature.model, resting(loop)
    skeleton, axes = skeleton_of(model, loop.walk.creature.trunk), gltf_axes(loop.walk.forward)
    rest, rest_rot = (each[0] for each in world_poses(model, skeleton, rest_qpos[None], axes))
    pos, rot = walked(loop, skeleton, axes, travelling)
    turned = rot @ rest_rot.transpose(0, 2, 1)
    # The file has no bone for the root, which stays on the floor.
    turned[:, 0], pos[:, 0], rest[0] = np.eye(3), 0.0, rest[1]
    bones = {}
    for i, parent in list(enumerate(skeleton.parent))[1:]:
        back, offset = turned[:, parent].transpose(0, 2, 1), rest[i] - rest[parent]
        place = (back @ (pos[:, i] - pos[:, parent])[..., None])[..., 0]
        moves = i == 1 or bool(np.abs(place - offset).max() > STILL)
        channels = [f"{a}position" for a in "XYZ"] * moves + [f"{a}rotation" for a in ORDER]
        columns = np.concatenate([place] * moves + [_angles(back @ turned[:, i])], 1)
        end = axes @ far_end(model, skeleton.bodies[i], rest_qpos)
        bones[i] = Bone(skeleton.names[i], parent, offset, channels, columns, end)
    return bones


def _branch(bones: Mapping[int, Bone], place: int, order: list[int]) -> list[str]:
    """The lines of a bone and of those below it. order: their places are appended to it."""
    bone = bones[place]
    order.append(place)
    below = [i for i, child in bones.items() if child.parent == place]
    return [
        f"{'JOINT' if bone.parent else 'ROOT'} {_word(bone.name)}",
        "{",
        f"OFFSET {_text(bone.offset)}",
        f"CHANNELS {len(bone.channels)} {' '.join(bone.channels)}",
        *(line for child in below for line in _branch(bones, child, order)),
        *([] if below else ["End Site", "{", f"OFFSET {_text(bone.end)}", "}"]),
        "}",
    ]


def _angles(rotations: np.ndarray) -> np.ndarray:
    """Angles [F, 3] in deg of rotations [F, 3, 3], without jumps by a full turn between frames."""
    angles = Rotation.from_matrix(rotations).as_euler(ORDER, degrees=True)
    return np.unwrap(angles, period=360.0, axis=0)


def _word(name: str) -> str:
    """A name as one word, as BVH requires."""
    return "_".join(name.split()) or "bone"


def _text(values: np.ndarray) -> str:
    return " ".join(f"{value:.6f}" for value in values)
