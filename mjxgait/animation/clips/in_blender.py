"""Runs inside Blender, alone: FBX to GLB, and an animated GLB to FBX.

  in_blender.py -- read FBX GLB MODE
  in_blender.py -- write GLB FBX RATE [NAME CHARACTER]

MODE: ACTIONS for all animations, ACTIVE_ACTIONS for the first. With CHARACTER, an FBX file, the
animation NAME is put on its armature, and all else is as there.
"""

import re
import struct
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix

UNITS = (
    rb"UnitScaleFactorS\x06\0\0\0doubleS\x06\0\0\0NumberS\0\0\0\0D(.{8})",
    rb'"UnitScaleFactor", *"double", *"(?:Number)?"(?:, *"")?, *([0-9.]+)',
)
"""Where an FBX file, binary or text, states its unit in cm."""
METRES = 100.0
BEFORE = -1
"""Frame at which nothing plays, so the file's own pose is that at rest."""


def main(words: Sequence[str]) -> None:
    """Do what the words say; see above."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    verb, source, made, how, *character = words
    if verb == "read":
        import_fbx(source)
        export_glb(made, how)
    elif character:
        name, file = character
        import_fbx(file)
        faster = int(how) / frames_per_s()
        own = actions_by_object()
        rest(own)
        set_rate(int(how))
        armature, action = brought(source, name)
        strips_of(own | {armature: [*own.get(armature, []), action]}, faster, action)
        export_fbx(made, in_metres(Path(file).read_bytes()))
    else:
        set_rate(int(how))
        import_glb(source)
        own = actions_by_object()
        rest(own)
        strips_of(own)
        export_fbx(made, True)


def in_metres(data: bytes) -> bool:
    """Return whether an FBX file counts in metres; most count in centimetres."""
    binary, text = (re.search(pattern, data, re.DOTALL) for pattern in UNITS)
    if binary:
        return bool(struct.unpack("<d", binary[1])[0] == METRES)
    return bool(text and float(text[1]) == METRES)


def export_glb(file: str, mode: str) -> None:
    """Write the scene at rest, with its animations."""
    call(
        bpy.ops.export_scene.gltf,
        filepath=file,
        export_format="GLB",
        export_animation_mode=mode,
        export_optimize_animation_size=False,
        export_anim_slide_to_zero=True,
        export_rest_position_armature=True,
        export_def_bones=False,
        export_extras=True,
        export_yup=True,
    )


def import_fbx(file: str) -> None:
    """Read an FBX file into the empty scene, which gets its frame rate."""
    if hasattr(bpy.ops.wm, "fbx_import"):  # since Blender 4.5; it also reads text
        call(bpy.ops.wm.fbx_import, filepath=file)
    else:
        call(bpy.ops.import_scene.fbx, filepath=file)
    for thing in [thing for thing in bpy.data.objects if thing.type == "ARMATURE"]:
        disconnect(thing)


def disconnect(armature: Any) -> None:
    """Let all bones move.

    An import connects a bone at the end of its parent, as hips above a root may be, and Blender
    never moves a connected bone, whatever its keys say.
    """
    armature.hide_viewport = False  # or it cannot be edited
    armature.hide_set(False)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in armature.data.edit_bones:
        bone.use_connect = False
    bpy.ops.object.mode_set(mode="OBJECT")


def import_glb(file: str) -> None:
    """Read a GLB file into the scene; bones keep the axes of their nodes."""
    call(
        bpy.ops.import_scene.gltf,
        filepath=file,
        bone_heuristic="BLENDER",
        disable_bone_shape=True,
    )


def export_fbx(file: str, metres: bool) -> None:
    """Write the scene: each strip an animation of its name, keyed on each frame.

    metres: the file counts in metres; else in centimetres, and what counts in metres is scaled.
    """
    bpy.context.scene.frame_set(BEFORE)
    call(
        bpy.ops.export_scene.fbx,
        filepath=file,
        apply_scale_options="FBX_SCALE_ALL" if metres else "FBX_SCALE_NONE",
        use_custom_props=True,
        add_leaf_bones=False,
        bake_anim_use_nla_strips=True,
        bake_anim_use_all_actions=False,
        bake_anim_simplify_factor=0.0,
        path_mode="COPY",
        embed_textures=True,
    )


def frames_per_s() -> float:
    """Return the frame rate of the scene."""
    render = bpy.context.scene.render
    return float(render.fps / render.fps_base)


def set_rate(rate: int) -> None:
    """Set the frame rate of the scene."""
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = rate, 1.0


def actions_by_object() -> dict[Any, list[Any]]:
    """Return the actions of each object that moves."""
    found: dict[Any, list[Any]] = {}
    for thing in bpy.data.objects:
        if thing.animation_data:
            own = [action for action in bpy.data.actions if belongs(action, thing)]
            found |= {thing: own} if own else {}
    return found


def belongs(action: Any, thing: Any) -> bool:
    """Return whether an import made an action, or a part of it, for an object."""
    if hasattr(action, "slots"):  # since Blender 4.4
        return slot_of(action, thing) is not None
    data = thing.animation_data
    tracks = {strip.action for track in data.nla_tracks for strip in track.strips}
    return action in {data.action, *tracks} or action.name.startswith(f"{thing.name}|")


def slot_of(action: Any, thing: Any) -> Any:
    """Return the part of an action that moves an object; None without one."""
    return next((s for s in action.slots if s.identifier == f"OB{thing.name}"), None)


def rest(things: Iterable[Any]) -> None:
    """Take all actions from objects and from shape keys, and put bones to rest."""
    for shapes in bpy.data.shape_keys:  # no strip of an object plays theirs
        shapes.animation_data_clear()
    for thing in things:
        data = thing.animation_data
        for track in list(data.nla_tracks):
            data.nla_tracks.remove(track)
        data.action = None
        for bone in thing.pose.bones if thing.type == "ARMATURE" else ():
            bone.matrix_basis = Matrix()


def strips_of(actions: Mapping[Any, Sequence[Any]], faster: float = 1.0, walk: Any = None) -> None:
    """Make each action of an object a strip, by which it is written under its own name.

    A strip has whole frames, so that a loop still closes. faster: frames of the scene per frame of
    an action but the walk.
    """
    for thing, own in actions.items():
        data = thing.animation_data
        for action in own:
            stay(thing, action)
        data.action = None
        for action in own:
            first, last = action.frame_range
            strip = data.nla_tracks.new().strips.new(action.name, 0, action)
            if hasattr(action, "slots"):
                strip.action_slot = slot_of(action, thing)
            strip.name, strip.extrapolation = action.name, "NOTHING"
            strip.action_frame_start, strip.action_frame_end = first, last
            if last > first:
                count = round((1.0 if action == walk else faster) * (last - first))
                strip.scale, strip.frame_end = count / (last - first), count


def stay(thing: Any, action: Any) -> None:
    """Key an object's location, rotation and scale in an action that has no curves for them.

    While a strip plays, Blender resets channels that only other strips animate: location to 0,
    scale to 1.
    """
    play(thing, action)
    known = {curve.data_path for curve in curves_of(action, thing)}
    mode = thing.rotation_mode
    turn = f"rotation_{mode.lower() if mode in ('QUATERNION', 'AXIS_ANGLE') else 'euler'}"
    for channel in {"location", turn, "scale"} - known:
        thing.keyframe_insert(channel, frame=action.frame_range[0])


def curves_of(action: Any, thing: Any) -> list[Any]:
    """Return the curves by which an action moves an object."""
    if not hasattr(action, "slots"):
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    own = slot_of(action, thing)
    return [curve for bag in bags if bag.slot == own for curve in bag.fcurves]


def brought(file: str, name: str) -> tuple[Any, Any]:
    """Put an animation of a GLB file onto the armature with its bones; return both."""
    mine = [thing for thing in bpy.data.objects if thing.type == "ARMATURE"]
    known = {*bpy.data.objects}, {*bpy.data.actions}
    import_glb(file)
    things, actions = (
        [one for one in all_of if one not in before]
        for all_of, before in zip((bpy.data.objects, bpy.data.actions), known, strict=True)
    )
    theirs = max((t for t in things if t.type == "ARMATURE"), key=lambda t: len(t.data.bones))
    names = {*theirs.data.bones.keys()}
    own = max(mine, key=lambda thing: len(names & {*thing.data.bones.keys()}))
    same = [action for action in actions if action.name == name]
    action = (same or [a for a in actions if a.name.startswith(name)])[0]
    rest([theirs])
    play(theirs, action)
    poses = [posed(own, theirs, frame) for frame in range(round(action.frame_range[1]) + 1)]
    bpy.data.batch_remove([*things, *actions])
    walk = keyed(own, poses, name)
    rest([own])
    return own, walk


def play(thing: Any, action: Any) -> None:
    """Make an action that of an object."""
    data = thing.animation_data
    data.action = action
    if hasattr(data, "action_slot"):
        data.action_slot = slot_of(action, thing) or next(iter(data.action_suitable_slots), None)


def posed(own: Any, theirs: Any, frame: int) -> dict[str, Matrix]:
    """Return what bones are given, by name, to turn from their rest in the scene as theirs do.

    So the axes of bones need not agree.
    """
    bpy.context.scene.frame_set(frame)
    here, there = own.matrix_world, theirs.matrix_world
    found: dict[str, Matrix] = {}
    given: dict[str, Matrix] = {}
    for bone in own.data.bones:  # parents first
        other, above = theirs.pose.bones.get(bone.name), bone.parent
        if other is not None:
            moved = there @ other.matrix @ (there @ other.bone.matrix_local).inverted()
            found[bone.name] = here.inverted() @ moved @ here @ bone.matrix_local
        elif above:
            still = above.matrix_local.inverted() @ bone.matrix_local
            found[bone.name] = found[above.name] @ still
        else:
            found[bone.name] = bone.matrix_local.copy()
        parents = (
            {"parent_matrix": found[above.name], "parent_matrix_local": above.matrix_local}
            if above
            else {}
        )
        given[bone.name] = bone.convert_local_to_pose(
            found[bone.name], bone.matrix_local, invert=True, **parents
        )
    return given


def keyed(armature: Any, poses: Sequence[Mapping[str, Matrix]], name: str) -> Any:
    """Make poses, from frame 0 on, a new action of an armature; return it.

    All of each pose is keyed, so that no other animation shows through.
    """
    data = armature.animation_data_create()
    data.action = action = bpy.data.actions.new(name)
    for bone in armature.pose.bones:
        bone.rotation_mode = "QUATERNION"  # as imports make it
        before = None
        for frame, pose in enumerate(poses):
            bone.location, turn, bone.scale = pose[bone.name].decompose()
            if before is not None:
                turn.make_compatible(before)
            bone.rotation_quaternion = before = turn
            for channel in ("location", "rotation_quaternion", "scale"):
                bone.keyframe_insert(channel, frame=frame, group=bone.name)
    return action


def call(operator: Any, **options: Any) -> None:
    """Call an operator with those options that this Blender knows."""
    known = operator.get_rna_type().properties.keys()
    operator(**{name: value for name, value in options.items() if name in known})


main(sys.argv[sys.argv.index("--") + 1 :])
