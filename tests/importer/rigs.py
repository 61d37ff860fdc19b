"""Skeletons that tests import: a dog as BVH, and the same dog as a skinned GLB."""

import struct
from collections.abc import Mapping

import numpy as np
import pygltflib as gltf

from mjxgait.animation.export.gltf import Buffer

Bone = tuple[str, tuple[float, float, float], tuple[float, float, float] | None]
"""Parent, place, and end of what has no bone below it; cm, Y up, forward +Z, left +X."""

LEGS: dict[str, Bone] = {
    "Thigh": ("Hips", (8, 44, -28), None),
    "Shin": ("Thigh", (8, 26, -20), None),
    "Hock": ("Shin", (8, 13, -33), None),
    "HindPaw": ("Hock", (8, 3, -30), (8, 2, -24)),
    "Arm": ("Chest", (8, 42, 14), None),
    "Forearm": ("Arm", (8, 25, 6), None),
    "Hand": ("Forearm", (8, 6, 9), (8, 2, 14)),
}
DOG: dict[str, Bone] = {
    "Hips": ("", (0, 48, -28), None),
    "Spine": ("Hips", (0, 50, -10), None),
    "Chest": ("Spine", (0, 50, 10), None),
    "Neck": ("Chest", (0, 54, 22), None),
    "Head": ("Neck", (0, 64, 32), (0, 62, 48)),
    "Tail": ("Hips", (0, 50, -34), (0, 44, -58)),
} | {
    side + name: (
        parent if parent in ("Hips", "Chest") else side + parent,
        (sign * place[0], *place[1:]),
        end and (sign * end[0], *end[1:]),
    )
    for side, sign in (("Left", 1), ("Right", -1))
    for name, (parent, place, end) in LEGS.items()
}


def bvh(
    bones: Mapping[str, Bone] = DOG, prefix: str = "", turned: Mapping[str, float] | None = None
) -> str:
    """A skeleton of two frames: at rest, and with bones turned about X by so many degrees."""
    order: list[str] = []

    def branch(name: str, above: tuple[float, float, float], depth: int) -> list[str]:
        _, place, end = bones[name]
        order.append(name)
        kind = "JOINT" if depth else "ROOT"
        moved = "Xposition Yposition Zposition "
        count, head = (6, moved) if not depth else (3, "")
        lines = [
            f"{kind} {prefix}{name}",
            "{",
            f"OFFSET {_between(above, place)}",
            f"CHANNELS {count} {head}Zrotation Xrotation Yrotation",
        ]
        for child in (n for n, bone in bones.items() if bone[0] == name):
            lines += branch(child, place, depth + 1)
        if end:
            lines += ["End Site", "{", f"OFFSET {_between(place, end)}", "}"]
        return [*lines, "}"]

    root = next(name for name, bone in bones.items() if not bone[0])
    hierarchy = branch(root, (0.0, 0.0, 0.0), 0)
    rows = [
        " ".join(["0 0 0", *(f"0 {angles.get(name, 0.0):g} 0" for name in order)])
        for angles in ({}, turned or {})
    ]
    motion = ["MOTION", "Frames: 2", "Frame Time: 0.033333", *rows]
    return "\n".join(["HIERARCHY", *hierarchy, *motion])


def _between(one: tuple[float, float, float], other: tuple[float, float, float]) -> str:
    return " ".join(f"{b - a:g}" for a, b in zip(one, other, strict=True))


def glb(
    bones: Mapping[str, Bone] = DOG,
    thick: float = 0.03,
    handles: bool = True,
    soles: bool = False,
    paws: Mapping[str, float] | None = None,
) -> bytes:
    """A mesh of rings about each bone that follow it alone, below an armature in centimetres.

    thick: m, radius of the rings. handles: a root on the floor, and a bone that moves no skin.
    soles: also a point above and one below the end of each limb. paws: m by bone, by which that
    below is further down.
    """
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0"))
    buffer = Buffer(document)
    names = [*bones]
    nodes = {name: gltf.Node(name=name) for name in names}
    world = {name: np.array(bone[1], float) for name, bone in bones.items()}
    for name, (parent, *_) in bones.items():
        nodes[name].translation = (world[name] - world.get(parent, np.zeros(3))).tolist()
        nodes[name].children = [names.index(n) for n in names if bones[n][0] == name]
    document.nodes = list(nodes.values())
    if handles:
        document.nodes += [
            gltf.Node(name="root", children=[0, len(names) + 1]),
            gltf.Node(name="ik_target", translation=[80.0, 0.0, 0.0]),
        ]
    top = len(names) if handles else 0
    document.nodes.append(gltf.Node(name="Armature", scale=[0.01] * 3, children=[top]))
    points, joints = [], []
    for i, (name, (_, _, end)) in enumerate(bones.items()):
        below = [world[n] for n in names if bones[n][0] == name] or [np.array(end, float)]
        for far in below:
            rings = _rings(0.01 * world[name], 0.01 * far, thick)
            points.append(rings)
            joints.append(np.full(len(rings), i))
        if soles and end:
            deep = thick + (paws or {}).get(name, 0.0)
            points.append(0.01 * np.array(end) + np.array([[0, thick, 0], [0, -deep, 0]]))
            joints.append(np.full(2, i))
    _add_skin(document, buffer, world, np.concatenate(points), np.concatenate(joints), handles)
    document.scenes = [gltf.Scene(nodes=[len(document.nodes) - 2, len(document.nodes) - 1])]
    buffer.close()
    return b"".join(document.save_to_bytes())


def _rings(start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Points about a line, m."""
    along = (end - start) / np.linalg.norm(end - start)
    one = np.cross(along, [0.3, 0.2, 0.9])
    one /= np.linalg.norm(one)
    other = np.cross(along, one)
    turn = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    ring = radius * (np.cos(turn)[:, None] * one + np.sin(turn)[:, None] * other)
    return np.concatenate([start + s * (end - start) + ring for s in (0.2, 0.5, 0.8)])


def _add_skin(
    document: gltf.GLTF2,
    buffer: Buffer,
    world: Mapping[str, np.ndarray],
    points: np.ndarray,
    joints: np.ndarray,
    handles: bool,
) -> None:
    inverse = np.tile(100.0 * np.eye(4), (len(world) + 2 * handles, 1, 1))
    inverse[:, 3, 3] = 1.0
    inverse[: len(world), :3, 3] = -np.array(list(world.values()))
    columns = inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32)
    followed = np.zeros((len(points), 4), np.uint8)
    followed[:, 0] = joints
    weights = np.tile(np.array([255, 0, 0, 0], np.uint8), (len(points), 1))
    parts = gltf.Attributes(
        POSITION=buffer.add(points.astype(np.float32), bounds=True),
        JOINTS_0=buffer.add(followed),
        WEIGHTS_0=buffer.add(weights, normalized=True),
    )
    document.meshes.append(gltf.Mesh(primitives=[gltf.Primitive(attributes=parts, mode=0)]))
    document.skins.append(
        gltf.Skin(joints=list(range(len(inverse))), inverseBindMatrices=buffer.add(columns))
    )
    document.nodes.append(gltf.Node(name="Mesh", mesh=0, skin=0))


def stated_longer(data: bytes) -> bytes:
    """A file whose header states more bytes than there are."""
    return data[:8] + struct.pack("<I", len(data) + 8) + data[12:]
