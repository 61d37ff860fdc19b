"""A walk as a GLB file: one skin with the creature's bodies as joints, animated by key frames.

Weights are rigid. glTF is Y-up with +Z forward and +X left, quaternions are (x, y, z, w), colours
linear. Letters: `F` key frames, `B` joints of the skin (the root on the floor, then the bodies),
`V` vertices.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.clips.clip import NOTE
from mjxgait.animation.clips.fbx import write_animated
from mjxgait.animation.export.facts import CONTACTS, facts_of, measured_facts
from mjxgait.animation.export.floor import add_tiles
from mjxgait.animation.export.gltf import Buffer, add_channel
from mjxgait.animation.export.loop import WalkLoop, animation_of
from mjxgait.animation.export.scenery import add_scenery
from mjxgait.animation.export.shaped import material_of, shaped
from mjxgait.animation.export.skeleton import (
    STILL,
    Skeleton,
    gltf_axes,
    local_poses,
    moved,
    resting,
    skeleton_of,
    world_poses,
)
from mjxgait.animation.export.surface import Piece, along_limbs, pieces_of
from mjxgait.champion.serializers import serializer_of

WALK = "walk"
"""Name of an exported walk; see `animation_of`."""
SAMPLES = 120
"""Samples of a cycle's motion, as many as the reader uses."""


def note_of(loop: WalkLoop) -> dict[str, str]:
    """The key poses of a walk and the resulting motion, as one text that editors keep."""
    champion, creature = loop.walk.champion, loop.walk.creature
    if champion.controller != "poses" or not loop.strides:
        return {}
    joints = creature.joints
    motion = {
        name: [round(float(v), 5) for v in _stride(loop, loop.qpos[:, place])]
        for name, place in zip(joints.names, joints.qpos, strict=True)
    }
    known = serializer_of("poses").document(champion.genome, champion.settings, creature)
    document = {
        "creature": champion.digest,
        "advance": champion.settings.advance,
        "motion": motion,
    }
    return {NOTE: json.dumps(document | known)}


def _stride(loop: WalkLoop, angles: np.ndarray) -> np.ndarray:
    """The first stride of angles [F], closed: the gap at its end is spread over it."""
    share = np.linspace(0.0, 1.0, SAMPLES + 1)
    at = share * (len(angles) - 1) / loop.strides
    samples = np.interp(at, np.arange(len(angles)), angles)
    closed: np.ndarray = (samples - share * (samples[-1] - samples[0]))[:-1]
    return closed


def export_glb(loop: WalkLoop, path: Path, travelling: bool = False) -> None:
    """Write the loop as GLB or FBX; see `build_glb`.

    Raises:
      UserError: the file cannot be written; FBX takes a Blender.
    """
    write_animated(path, build_glb(loop, travelling, footfalls=True), loop.rate)


def build_glb(
    loop: WalkLoop, travelling: bool = False, floor: bool = False, footfalls: bool = False
) -> bytes:
    """The bytes of the file.

    travelling: the root moves forward at an even speed; otherwise the creature walks in place.
    floor: what is around it passes; see `add_scenery`. footfalls: the file states the gait, and when
    feet are down.
    """
    document, buffer = _scene({animation_of(WALK, loop): loop}, travelling)
    if floor:
        add_scenery(document, buffer, loop)
    facts = facts_of(loop, travelling)
    if footfalls:
        facts = measured_facts(loop, travelling, loop.walk.creature.feet.names)
        document.animations[0].extras = facts
    document.extras = {key: fact for key, fact in facts.items() if key != CONTACTS}
    # Blender keeps a node's extras and drops the file's.
    document.nodes[0].extras = document.extras | note_of(loop)
    buffer.close()
    return b"".join(document.save_to_bytes())


def build_clips(loops: Mapping[str, WalkLoop], travelling: bool = False) -> bytes:
    """The bytes of a file with several loops of one creature as animations, by name.

    All move the same joints, so that programs can blend them. Each states its facts and footfalls.
    """
    document, buffer = _scene(loops, travelling)
    for animation, loop in zip(document.animations, loops.values(), strict=True):
        feet = loop.walk.creature.feet.names
        animation.extras = measured_facts(loop, travelling, feet)
    buffer.close()
    return b"".join(document.save_to_bytes())


def build_driven(loops: Mapping[str, WalkLoop]) -> tuple[bytes, float]:
    """The bytes of a file with loops in place, on tiles for the player to move.

    Also returns the distance of two tiles in m.
    """
    document, buffer = _scene(loops, travelling=False)
    walk = next(iter(loops.values())).walk
    apart = add_tiles(document, buffer, walk.creature.frame.body_length)
    buffer.close()
    return b"".join(document.save_to_bytes()), apart


def _scene(loops: Mapping[str, WalkLoop], travelling: bool) -> tuple[gltf.GLTF2, Buffer]:
    """The creature with its skin, and the animations."""
    loop = next(iter(loops.values()))
    creature = loop.walk.creature
    axes = gltf_axes(loop.walk.forward)
    plain = skeleton_of(creature.model, creature.trunk)
    skeleton = along_limbs(creature.model, plain, resting(loop), axes)
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator="mjxgait"))
    buffer = Buffer(document)
    rest_pos, rest_quat = local_poses(creature.model, skeleton, resting(loop)[None], axes)
    _add_joints(document, skeleton, rest_pos[0], rest_quat[0])
    _add_mesh(document, buffer, pieces_of(loop.walk.dressed, skeleton, axes, resting(loop)))
    _add_skin(document, buffer, creature.model, skeleton, axes, resting(loop))
    _add_animations(document, buffer, loops, skeleton, axes, travelling)
    name = creature.name
    document.nodes.append(gltf.Node(name=name, mesh=0, skin=0))
    document.scenes = [gltf.Scene(name=name, nodes=[0, len(document.nodes) - 1])]
    document.scene = 0
    return document, buffer


def _add_joints(
    document: gltf.GLTF2, skeleton: Skeleton, pos: np.ndarray, quat: np.ndarray
) -> None:
    for b, name in enumerate(skeleton.names):
        children = [c for c, parent in enumerate(skeleton.parent) if parent == b]
        node = gltf.Node(name=name, translation=pos[b].tolist(), rotation=quat[b].tolist())
        if children:
            node.children = children
        document.nodes.append(node)


def _add_mesh(document: gltf.GLTF2, buffer: Buffer, pieces: Sequence[Piece]) -> None:
    """One primitive and material per piece."""
    primitives = [_primitive(buffer, piece, i) for i, piece in enumerate(pieces)]
    document.materials += [material_of(piece.name, piece.colour) for piece in pieces]
    document.meshes.append(gltf.Mesh(name="body", primitives=primitives))


def _primitive(buffer: Buffer, piece: Piece, material: int) -> gltf.Primitive:
    count, joints = len(piece.points), piece.joints
    places = np.zeros((count, 4), np.uint16 if joints.max() > 255 else np.uint8)
    places[:, 0] = joints
    weights = np.tile(np.array([255, 0, 0, 0], np.uint8), (count, 1))
    primitive = shaped(buffer, (piece.points, piece.normals, piece.faces), material)
    primitive.attributes.JOINTS_0 = buffer.add(places, gltf.ARRAY_BUFFER)
    primitive.attributes.WEIGHTS_0 = buffer.add(weights, gltf.ARRAY_BUFFER, normalized=True)
    return primitive


def _add_skin(
    document: gltf.GLTF2,
    buffer: Buffer,
    model: mujoco.MjModel,
    skeleton: Skeleton,
    axes: np.ndarray,
    stand: np.ndarray,
) -> None:
    pos, rot = world_poses(model, skeleton, stand[None], axes)
    inverse = np.zeros((len(skeleton.names), 4, 4))
    inverse[:, :3, :3] = rot[0].transpose(0, 2, 1)
    inverse[:, :3, 3] = -(inverse[:, :3, :3] @ pos[0][..., None])[..., 0]
    inverse[:, 3, 3] = 1.0
    # glTF stores matrices column by column.
    columns = inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32)
    document.skins.append(
        gltf.Skin(
            name="skeleton",
            joints=list(range(len(skeleton.names))),
            skeleton=0,
            inverseBindMatrices=buffer.add(columns),
        )
    )


def _add_animations(
    document: gltf.GLTF2,
    buffer: Buffer,
    loops: Mapping[str, WalkLoop],
    skeleton: Skeleton,
    axes: np.ndarray,
    travelling: bool,
) -> None:
    """Add an animation for each loop; all have the joints that move in any of them."""
    rest = [(node.translation, node.rotation) for node in document.nodes]
    tracks = {name: moved(loop, skeleton, axes, travelling) for name, loop in loops.items()}
    moving = [
        (b, i)
        for b, still in enumerate(rest)
        for i in (0, 1)
        if any(np.abs(track[i][:, b] - still[i]).max() > STILL for track in tracks.values())
    ]
    for name, loop in loops.items():
        animation = gltf.Animation(name=name)
        times = buffer.add(loop.times.astype(np.float32), bounds=True)
        for b, i in moving:
            path = ("translation", "rotation")[i]
            add_channel(buffer, animation, times, b, path, tracks[name][i][:, b])
        document.animations.append(animation)
