"""Characters from Blender to files, and motions from files onto armatures.

A bone of the file turns from its rest as the same bone in Blender is to turn from its own, so axes
of bones need not agree. Lengths are Blender's; Z is up.
"""

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Quaternion

from .commands import NotStarted
from .footfalls import footfalls_in

STILL = 1e-5
"""Change of a number of a bone's pose below which the bone gets no key frames for it."""
KINDS = (
    *("objects", "meshes", "armatures", "materials", "images", "textures"),
    *("actions", "collections", "cameras", "lights", "node_groups"),
)
"""Data that an import may bring."""


def chosen_armature(context: Any) -> Any:
    """Return the active armature, or that of the active mesh; None without one."""
    thing = context.object
    if thing is None or thing.type == "ARMATURE":
        return thing
    return thing.find_armature()


def meshes_of(armature: Any) -> list[Any]:
    """Return the meshes that an armature moves."""
    return [t for t in bpy.data.objects if t.type == "MESH" and t.find_armature() == armature]


def export_character(armature: Any, file: Path, deform_only: bool, animated: bool) -> None:
    """Write the armature with its meshes as GLB.

    deform_only: leave out bones that move no skin. animated: with the current action; else at rest.

    Raises:
      NotStarted: it has no skin or cannot be selected.
    """
    skins = meshes_of(armature)
    if not skins:
        raise NotStarted(
            f'"{armature.name}" moves no mesh; parent a mesh to it with weights, then try again'
        )
    with _selected([armature, *skins]):
        bpy.context.view_layer.update()  # places that a script has set
        _call(
            bpy.ops.export_scene.gltf,
            filepath=str(file),
            export_format="GLB",
            use_selection=True,
            export_animations=animated,
            export_animation_mode="ACTIVE_ACTIONS",
            export_optimize_animation_size=False,
            export_anim_slide_to_zero=True,
            export_def_bones=deform_only,
            export_rest_position_armature=True,
            export_materials="NONE",
            export_morph=False,
            export_extras=True,
            export_yup=True,
        )


def bring_motion(armature: Any, file: Path, name: str, called: str) -> tuple[Any, list[str]]:
    """Put an animation of a file onto the armature as a new action; the old one is kept.

    Args:
      file: GLB with the same character. name: of the animation. called: the new action's name.

    Returns:
      The action, with a pose marker at each footfall, and the names of bones that the armature lacks.

    Raises:
      NotStarted: the file has not this animation.
    """
    scene, was = bpy.context.scene, bpy.context.scene.frame_current
    with _imported(file) as (things, actions):
        brought = next((thing for thing in things if thing.type == "ARMATURE"), None)
        action = next((a for a in actions if a.name.startswith(name)), None)
        if brought is None or action is None:
            raise NotStarted(f'{file}: holds no animation "{name}"')
        _play(brought, action)
        first, last = action.frame_range
        poses = _poses(scene, armature, brought, first, last)
        lost = [bone.name for bone in brought.pose.bones if bone.name not in armature.pose.bones]
        scene.frame_set(was)
    made = _keyed(armature, poses, called, scene.frame_start)
    frames_per_s = scene.render.fps / scene.render.fps_base
    stretched = (len(poses) - 1) / max(last - first, 1.0)
    for foot, time in footfalls_in(file, name):
        marker = made.pose_markers.new(foot)
        marker.frame = scene.frame_start + round(time * frames_per_s * stretched)
    return made, lost


def _poses(
    scene: Any, armature: Any, brought: Any, first: float, last: float
) -> list[dict[str, Matrix]]:
    """Return the pose of each bone against its rest and its parent, frame by frame.

    Frames are as many as fit best, so a cycle ends on a whole frame.
    """
    count = max(round(last - first), 1)
    frames = []
    for number in range(count + 1):
        at = first + (last - first) * number / count
        scene.frame_set(int(at // 1), subframe=at % 1)
        frames.append(_own_poses(armature, brought))
    return frames


def _own_poses(armature: Any, brought: Any) -> dict[str, Matrix]:
    """Return what the armature's bones are to be given, by name."""
    own, theirs = armature.matrix_world, brought.matrix_world
    posed: dict[str, Matrix] = {}
    given: dict[str, Matrix] = {}
    for bone in armature.data.bones:  # parents first
        other = brought.pose.bones.get(bone.name)
        above = bone.parent and posed[bone.parent.name]
        if other is None:
            rest = bone.parent.matrix_local.inverted() @ bone.matrix_local if bone.parent else None
            posed[bone.name] = above @ rest if rest else bone.matrix_local.copy()
            continue
        moved = theirs @ other.matrix @ (theirs @ other.bone.matrix_local).inverted()
        posed[bone.name] = own.inverted() @ moved @ own @ bone.matrix_local
        parent = (
            {"parent_matrix": above, "parent_matrix_local": bone.parent.matrix_local}
            if bone.parent
            else {}
        )
        given[bone.name] = bone.convert_local_to_pose(
            posed[bone.name], bone.matrix_local, invert=True, **parent
        )
    return given


def _keyed(armature: Any, frames: list[dict[str, Matrix]], called: str, start: int) -> Any:
    """Make the poses a new action of the armature, which repeats; return it."""
    data = armature.animation_data_create()
    if data.action:
        data.action.use_fake_user = True
    data.action = action = bpy.data.actions.new(called)
    for name in frames[0]:
        bone = armature.pose.bones[name]
        for path, values in _channels(bone, [frame[name] for frame in frames]).items():
            for number, value in enumerate(values):
                setattr(bone, path, value)
                bone.keyframe_insert(path, frame=start + number, group=name)
    action.use_fake_user = action.use_frame_range = action.use_cyclic = True
    action.frame_start, action.frame_end = start, start + len(frames) - 1
    for curve in curves_of(action):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
        repeat = curve.modifiers.new("CYCLES")
        if curve.data_path.endswith("location"):  # which may move on
            repeat.mode_before = repeat.mode_after = "REPEAT_OFFSET"
    return action


def _channels(bone: Any, poses: list[Matrix]) -> dict[str, list[Any]]:
    """Return the values, frame by frame, of each property of a bone that moves or must be reset."""
    places = [pose.to_translation() for pose in poses]
    turns: list[Any] = []
    for pose in poses:
        turn = pose.to_quaternion()
        if turns:
            turn.make_compatible(turns[-1])
        turns.append(turn)
    found: dict[str, list[Any]] = {}
    if any(place.length > STILL for place in places) or bone.location.length > STILL:
        found["location"] = places
    if bone.rotation_mode == "QUATERNION":
        return found | {"rotation_quaternion": turns}
    if bone.rotation_mode == "AXIS_ANGLE":
        return found | {"rotation_axis_angle": [_axis_angle(turn) for turn in turns]}
    eulers: list[Any] = []
    for turn in turns:
        before = eulers[-1:]
        eulers.append(turn.to_euler(bone.rotation_mode, *before))
    return found | {"rotation_euler": eulers}


def _axis_angle(turn: Quaternion) -> tuple[float, ...]:
    axis, angle = turn.to_axis_angle()
    return (angle, *axis)


def curves_of(action: Any) -> list[Any]:
    """Return the curves of an action, in Blender before 5.0 and after."""
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def _play(brought: Any, action: Any) -> None:
    """Make an imported action the armature's own and only one."""
    data = brought.animation_data_create()
    for track in data.nla_tracks:
        track.mute = True
    data.action = action
    if hasattr(data, "action_slot") and data.action_slot is None:
        data.action_slot = next(iter(data.action_suitable_slots), None)


@contextlib.contextmanager
def _imported(file: Path) -> Iterator[tuple[list[Any], list[Any]]]:
    """Yield the objects and actions of a file; they and their data are gone after the block."""
    before = {kind: set(getattr(bpy.data, kind)) for kind in KINDS}
    with _selected(()):
        try:
            _call(
                bpy.ops.import_scene.gltf,
                filepath=str(file),
                bone_heuristic="BLENDER",
                disable_bone_shape=True,
            )
            yield (
                [thing for thing in bpy.data.objects if thing not in before["objects"]],
                [action for action in bpy.data.actions if action not in before["actions"]],
            )
        finally:
            new = [d for kind in KINDS for d in set(getattr(bpy.data, kind)) - before[kind]]
            bpy.data.batch_remove(new)


@contextlib.contextmanager
def _selected(things: Iterable[Any]) -> Iterator[None]:
    """Select these objects alone for the duration of the block, in object mode.

    Raises:
      NotStarted: one of them is hidden or in no scene.
    """
    layer = bpy.context.view_layer
    active, mode = layer.objects.active, bpy.context.mode
    selected = [thing for thing in layer.objects if thing.select_get()]
    if mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    try:
        _select(layer, things)
        yield
    finally:
        _select(layer, selected)
        layer.objects.active = active
        if mode.startswith("POSE"):
            bpy.ops.object.mode_set(mode="POSE")


def _select(layer: Any, things: Iterable[Any]) -> None:
    for thing in layer.objects:
        thing.select_set(False)
    for thing in things:
        try:
            thing.select_set(True)
            layer.objects.active = layer.objects.active or thing
        except RuntimeError:
            raise NotStarted(f'"{thing.name}" is not in this view layer; show it first') from None
        if not thing.select_get():
            raise NotStarted(f'"{thing.name}" is hidden, so it cannot be exported; show it first')


def _call(operator: Any, **options: Any) -> None:
    """Call an operator with those options that this Blender knows."""
    known = operator.get_rna_type().properties.keys()
    operator(**{name: value for name, value in options.items() if name in known})
