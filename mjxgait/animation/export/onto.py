"""Walks as animations of the user's own character.

The creature was imported from the skeleton of that character. Nothing of the file changes; key
frames follow at its end. At rest the parts of the creature are where the bones are, so a bone turns
from its rest as its part does. Letters: `F` key frames, `B` parts that have a bone, `N` nodes of
the file.
"""

import itertools
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.fbx import write_animated
from mjxgait.animation.clips.glb_document import DAMAGED, damaged
from mjxgait.animation.clips.read_glb import name_of
from mjxgait.animation.export.character import Character
from mjxgait.animation.export.facts import measured_facts
from mjxgait.animation.export.fit import Placement, fitted, lows, quoted
from mjxgait.animation.export.gltf import Buffer, add_channel, added
from mjxgait.animation.export.loop import LOOP, WalkLoop, animation_of
from mjxgait.animation.export.planted import planted
from mjxgait.animation.export.posed import Goal, posed
from mjxgait.animation.export.skeleton import (
    STILL,
    gltf_axes,
    quaternions,
    resting,
    skeleton_of,
    walked,
    world_poses,
)
from mjxgait.creature import Creature
from mjxgait.errors import UserError

EVEN = 1e-3
"""Relative difference of two scales, from which a bone below them would be sheared."""


def export_onto(loop: WalkLoop, character: Character, path: Path, travelling: bool = False) -> str:
    """Write the loop as GLB or FBX; see `build_onto`. Return the animation's name.

    Raises:
      UserError: the file has not the creature's skeleton, or cannot be written.
    """
    name = animation_of("walk", loop)
    names, data = build_onto({name: loop}, character, travelling)
    write_animated(path, data, loop.rate, names[name], character.path)
    return names[name]


def build_onto(
    loops: Mapping[str, WalkLoop], character: Character, travelling: bool = False
) -> tuple[dict[str, str], bytes]:
    """The bytes of the character's file with loops of one creature as animations.

    All move the same bones, so that programs can blend them. The first value is the name of each
    animation by the name of its loop; they differ if the file has one of that name.

    travelling: the topmost bone moves on evenly; otherwise the character walks in place.

    Raises:
      UserError: the file has not the creature's skeleton.
    """
    loop = next(iter(loops.values()))
    bones = bones_of(loop.walk.creature, character)
    try:
        fit, goals = planted(
            loops,
            character,
            bones,
            fitted(loop, character, bones),
            lambda each, fit: _goals(each, character, bones, fit, travelling),
        )
        tracks = {name: _tracks(character, own) for name, own in goals.items()}
        return _finished(loops, character, bones, fit, tracks, travelling)
    except DAMAGED as error:
        raise damaged(character.path) from error


def bones_of(creature: Creature, character: Character) -> dict[str, int]:
    """Node of the file by part of the creature.

    Raises:
      UserError: the file lacks its bones, or the creature has none.
    """
    rig = creature.settings.rig
    if not creature.is_rig:
        raise UserError(
            f"{creature.name}: was not made of a character's skeleton, so no file has its bones; "
            "leave --onto out, or import your character and train it"
        )
    if creature.model.body(creature.trunk).name not in rig.bones:
        raise UserError(
            f"{creature.name}: its folder does not say which bones its parts are, because an earlier "
            "version imported it; import the character again, and train it"
        )
    found = {part: character.bones.get(bone, ()) for part, bone in rig.bones.items()}
    if lost := [rig.bones[part] for part, nodes in found.items() if not nodes]:
        raise UserError(
            f"{character.path}: lacks bones of which {creature.name} was made: {quoted(lost)}; name "
            f"the file that was imported ({rig.file}), or import this one and train it"
        )
    if twice := [rig.bones[part] for part, nodes in found.items() if len(nodes) > 1]:
        raise UserError(
            f"{character.path}: has several bones called {quoted(twice)}; give each its own name, "
            "import the file again, and train it"
        )
    return {part: nodes[0] for part, nodes in found.items()}


def _bones_of_feet(loop: WalkLoop, names_of: Mapping[str, str]) -> list[str]:
    """The bone of each foot that is lowest at rest: of a leg with a fixed paw, the paw."""
    creature, heights = loop.walk.creature, lows(loop, resting(loop)[None])[0]
    model, feet = creature.model, creature.feet
    found = []
    for foot, name in enumerate(feet.names):
        lowest = np.where(feet.foot_of == foot, heights, np.inf).argmin()
        part = model.body(model.geom_bodyid[feet.stepping[lowest]]).name
        found.append(names_of.get(part, names_of.get(name, name)))
    return found


def _goals(
    loop: WalkLoop, character: Character, bones: Mapping[str, int], fit: Placement, travelling: bool
) -> dict[int, Goal]:
    """Goals by node.

    Below another bone, a bone keeps its own place against it, which is more exact than the part's.
    """
    creature = loop.walk.creature
    skeleton, axes = skeleton_of(creature.model, creature.trunk), gltf_axes(loop.walk.forward)
    _, still = world_poses(creature.rest_model, skeleton, resting(loop)[None], axes)
    pos, rot = walked(loop, skeleton, axes, travelling)
    turned = fit.turns(rot @ still.transpose(0, 1, 3, 2))
    goals = {}
    for part, node in bones.items():
        at = skeleton.names.index(part, 1)  # the first is the root on the floor
        world = np.tile(character.world[node], (len(pos), 1, 1))
        world[:, :3, :3] = turned[:, at] @ world[:, :3, :3]
        world[:, :3, 3] = fit.places(pos[:, at])
        free = not any(above in bones.values() for above in character.above(node))
        goals[node] = Goal(world, free)
    top = _root_bone(character, bones[creature.model.body(creature.trunk).name], goals)
    if travelling and top is not None:
        world = np.tile(character.world[top], (len(pos), 1, 1))
        world[:, :3, :3] = turned[:, 0] @ world[:, :3, :3]
        away = world[:, :3, 3] - fit.shift
        world[:, :3, 3] = fit.places(pos[:, 0]) + (turned[:, 0] @ away[..., None])[..., 0]
        goals[top] = Goal(world, True)
    for node in goals:
        _check_scale(character, node)
    return goals


def _root_bone(character: Character, trunk: int, goals: Mapping[int, Goal]) -> int | None:
    """The topmost bone above the trunk's, which engines take for the root; None without one."""
    joints = {node for nodes in character.bones.values() for node in nodes} - set(goals)
    return next((node for node in reversed(character.above(trunk)) if node in joints), None)


Channel = tuple[int, str]
"""Node, and its path: rotation or translation."""


def _tracks(character: Character, goals: Mapping[int, Goal]) -> dict[Channel, np.ndarray]:
    """Values [F, 3 or 4] of the goals' channels."""
    local, _ = posed(character, goals)
    tracks: dict[Channel, np.ndarray] = {}
    for node in goals:
        tracks[node, "rotation"] = _turns(character, node, local[:, node])
        tracks[node, "translation"] = local[:, node, :3, 3]
    return tracks


def _check_scale(character: Character, node: int) -> None:
    """Refuse a bone that would be sheared, which key frames cannot express."""
    for place in (node, character.parents[node]):
        if place < 0:
            continue
        # A bone itself may be scaled along its own axes.
        axes = (character.local if place == node else character.world)[place, :3, :3]
        square = axes.T @ axes
        size = np.diag(square) if place == node else np.full(3, np.trace(square) / 3)
        if np.abs(square - np.diag(size)).max() > EVEN * size.max():
            name = name_of(character.nodes, place)
            raise UserError(
                f'{character.path}: "{name}" has another scale along each axis, so what is below it '
                "cannot turn; apply its scale in your program, and export the file again"
            )


def _turns(character: Character, node: int, local: np.ndarray) -> np.ndarray:
    """Quaternions [F, 4] of a node with transforms [F, 4, 4] against its parent."""
    _, quat, _ = character.split(node)
    back = np.linalg.inv(character.local[node, :3, :3]) @ Rotation.from_quat(quat).as_matrix()
    quats = quaternions(local[:, :3, :3] @ back)
    quats *= np.copysign(1.0, quats[0] @ quat)
    return quats


def _moving(character: Character, tracks: Iterable[Mapping[Channel, np.ndarray]]) -> list[Channel]:
    """The channels that leave their rest in any loop."""
    found: dict[Channel, bool] = {}
    for track in tracks:
        for (node, path), values in track.items():
            place, quat, _ = character.split(node)
            still = quat if path == "rotation" else place
            moves = bool(np.abs(values - still).max() > STILL)
            found[node, path] = found.get((node, path), False) or moves
    return [channel for channel, moves in found.items() if moves]


def _finished(
    loops: Mapping[str, WalkLoop],
    character: Character,
    bones: Mapping[str, int],
    fit: Placement,
    tracks: Mapping[str, Mapping[Channel, np.ndarray]],
    travelling: bool,
) -> tuple[dict[str, str], bytes]:
    """The names of the animations, and the bytes of the file."""
    document = gltf.GLTF2()
    buffer, names = Buffer(document), _free_names(loops, character.clips)
    moving = _moving(character, tracks.values())
    names_of = {part: name_of(character.nodes, node) for part, node in bones.items()}
    feet = _bones_of_feet(next(iter(loops.values())), names_of)
    for name, loop in loops.items():
        animation = gltf.Animation(name=names[name])
        times = buffer.add(loop.times.astype(np.float32), bounds=True)
        for node, path in moving:
            add_channel(buffer, animation, times, node, path, tracks[name][node, path])
        animation.extras = measured_facts(loop, travelling, feet, fit.factor)
        document.animations.append(animation)
    # glTF allows no key frames for a node that is placed by a matrix.
    placed = {node for node, _ in moving if character.nodes[node].matrix}
    return names, added(
        character.data, buffer, {node: _unmatrixed(character, node) for node in placed}
    )


def _free_names(loops: Iterable[str], taken: Collection[str]) -> dict[str, str]:
    """A name that the file does not have yet for each loop."""
    names = {}
    for name in loops:
        stem, end = name.removesuffix(LOOP), LOOP * name.endswith(LOOP)
        tries = (f"{stem}_{i}{end}" if i > 1 else name for i in itertools.count(1))
        names[name] = next(each for each in tries if each not in taken)
    return names


def _unmatrixed(character: Character, node: int) -> dict[str, object]:
    """Keys of a node placed by translation, rotation and scale instead of its matrix."""
    keys = ("translation", "rotation", "scale")
    split = zip(keys, character.split(node), strict=True)
    return {"matrix": None} | {key: values.tolist() for key, values in split}
