"""Open an exported walk in Blender, report its contents, turn bones and export it again.

PYTHON benchmarks/in_blender.py IN.glb OUT.glb --turn hind_left_upper=-12 --picture bones.png

Needs a Python that has Blender as a module (`pip install bpy`). Turns bones at every frame, as an
animator would. Prints one line of JSON. Lengths are m; Blender has Z up.
"""

import argparse
import json
from pathlib import Path

import bpy
from mathutils import Quaternion, Vector

SIZE, SAMPLES = (560, 400), 64
THICK = 0.06
"""Half width of a drawn bone over its length."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--turn", nargs="*", default=[], metavar="BONE=DEGREES")
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args()
    turns = {name: float(degrees) for name, degrees in (text.split("=") for text in given.turn)}
    skeleton = opened(given.file)
    told = said(skeleton)
    for name, degrees in turns.items():
        turn(skeleton, name, degrees)
    bpy.ops.export_scene.gltf(
        filepath=str(given.out),
        export_format="GLB",
        export_extras=True,
        export_optimize_animation_size=False,
    )
    if given.picture:
        draw(skeleton, given.picture)
    print("told", json.dumps(told))


def opened(file: Path) -> bpy.types.Object:
    """Return a file's skeleton in a scene with its frame rate, so that keys lie on frames."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(file))
    rate = next(b["frames_per_s"] for b in armature().data.bones if "frames_per_s" in b)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = rate
    bpy.ops.import_scene.gltf(filepath=str(file), disable_bone_shape=True)
    skeleton = armature()
    skeleton.animation_data.action.use_cyclic = True
    scene, ends = bpy.context.scene, skeleton.animation_data.action.frame_range
    scene.frame_start, scene.frame_end = round(ends[0]), round(ends[1])
    return skeleton


def armature() -> bpy.types.Object:
    return next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")


def said(skeleton: bpy.types.Object) -> dict[str, object]:
    """Describe what a user sees of the file."""
    action = skeleton.animation_data.action
    ends = action.frame_range
    return {
        "blender": bpy.app.version_string,
        "action": action.name,
        "frames": [ends[0], ends[1]],
        "seconds": (ends[1] - ends[0]) / bpy.context.scene.render.fps,
        "materials": [material.name for material in bpy.data.materials],
        "extras": {b.name: list(b.keys()) for b in skeleton.data.bones if list(b.keys())},
        "bones": {
            bone.name: {"head": list(bone.head_local), "tail": list(bone.tail_local)}
            for bone in skeleton.data.bones
        },
    }


def turn(skeleton: bpy.types.Object, name: str, degrees: float) -> None:
    """Turn a bone about its own X axis, at every frame."""
    bone, scene = skeleton.pose.bones[name], bpy.context.scene
    bent = Quaternion((1.0, 0.0, 0.0), degrees / 57.29577951308232)
    keys = []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        keys.append((frame, bone.rotation_quaternion @ bent))
    for frame, turned in keys:
        bone.rotation_quaternion = turned
        bone.keyframe_insert("rotation_quaternion", frame=frame)


def draw(skeleton: bpy.types.Object, file: Path) -> None:
    """Draw the creature at rest, transparent, with its bones as Blender draws them.

    Renders on the processor, which needs no display.
    """
    scene = bpy.context.scene
    skeleton.data.pose_position = "REST"
    for material in bpy.data.materials:
        look = material.node_tree.nodes["Principled BSDF"]
        look.inputs["Alpha"].default_value = 0.25
    orange = bpy.data.materials.new("bone")
    orange.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.9, 0.3, 0, 1)
    for bone in skeleton.data.bones:
        if bone.parent:
            add_bone(bone.head_local, bone.tail_local, orange)
    bodies = [thing for thing in bpy.data.objects if thing.type == "MESH" and thing.vertex_groups]
    corners = [Vector(corner) for body in bodies for corner in body.bound_box]
    low, high = (Vector(pick(c[i] for c in corners) for i in range(3)) for pick in (min, max))
    middle, reach = (low + high) / 2, (high - low).length
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = middle + reach * Vector((1.3, -1.05, 0.4))
    camera.rotation_euler = (middle - camera.location).to_track_quat("-Z", "Y").to_euler()
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.0, (0.6, 0.3, 0.4)
    for thing in (camera, sun):
        scene.collection.objects.link(thing)
    scene.world = bpy.data.worlds.new("world")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    scene.camera, scene.render.engine, scene.cycles.samples = camera, "CYCLES", SAMPLES
    scene.cycles.use_denoising = True
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)


def add_bone(head: Vector, tail: Vector, material: bpy.types.Material) -> None:
    """Add an octahedron from a bone's head to its tail."""
    way = tail - head
    turned = way.to_track_quat("Y", "Z")
    thick, waist = THICK * way.length, head + 0.1 * way
    ring = [
        waist + turned @ Vector((x * thick, 0, z * thick))
        for x, z in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    sides = [(i, (i + 1) % 4) for i in range(4)]
    mesh = bpy.data.meshes.new("bone")
    faces = [(2 + a, 2 + b, 0) for a, b in sides] + [(2 + b, 2 + a, 1) for a, b in sides]
    mesh.from_pydata([head, tail, *ring], [], faces)
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("bone", mesh))


if __name__ == "__main__":
    main()
