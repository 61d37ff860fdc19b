"""FBX files for tests, and what a Blender shows of files.

PYTHON fbx_in_blender.py make GLB FOLDER
PYTHON fbx_in_blender.py see FILE NAME RATE OUT.npz

`make` writes cm.fbx, as Maya leaves a character, and m.fbx, in metres without animation. `see`
writes the skinned vertices [F, V, 3] in m, Z up, on each frame of an animation.
"""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from rig_of_blender import wrapped

SLOW = 24
"""Frames/s of the file with an animation of its own."""


def make(glb: str, folder: str) -> None:
    armature = opened(glb)
    write(folder, "m.fbx", apply_scale_options="FBX_SCALE_ALL", add_leaf_bones=False)
    armature.rotation_mode = "XYZ"
    armature.rotation_euler.z += math.radians(30)
    armature.location = (0.4, -0.2, 0.0)
    bpy.context.scene.render.fps = SLOW
    head = armature.pose.bones["Head"]
    for frame, angle in ((0, 0.0), (10, 0.4), (21, 0.0)):
        head.rotation_quaternion = (math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0)
        head.keyframe_insert("rotation_quaternion", frame=frame)
    armature.animation_data.action.name = "nod"
    write(folder, "cm.fbx", bake_anim_use_nla_strips=False)


def opened(glb: str) -> bpy.types.Object:
    """The character with bones along its limbs, rolled, and with a mesh in two colours."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=glb, bone_heuristic="BLENDER", disable_bone_shape=True)
    armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    for thing in [thing for thing in bpy.data.objects if thing.type == "MESH"]:
        bpy.data.objects.remove(thing)  # a mesh of points, which Blender does not export
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for number, bone in enumerate(armature.data.edit_bones):
        bone.tail = bone.children[0].head if bone.children else bone.head + Vector((0, -5, -1))
        bone.roll = 0.3 + 0.2 * number
    bpy.ops.object.mode_set(mode="OBJECT")
    wrapped(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    bones.new("root").tail = bones["Hips"].head  # to which an import connects the hips
    bones["Hips"].parent = bones["root"]
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = bpy.data.meshes["skin"]
    for name, colour in (("fur", (0.8, 0.4, 0.1, 1.0)), ("sock", (0.9, 0.9, 0.9, 1.0))):
        mesh.materials.append(bpy.data.materials.new(name))
        mesh.materials[-1].use_nodes = True
        mesh.materials[-1].node_tree.nodes["Principled BSDF"].inputs[0].default_value = colour
    for face in mesh.polygons:
        face.material_index = face.index % 2
    return armature


def write(folder: str, name: str, **options: object) -> None:
    bpy.ops.export_scene.fbx(filepath=str(Path(folder) / name), **options)


def see(file: str, name: str, rate: str, out: str) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps = int(rate)
    if file.endswith(".fbx"):
        bpy.ops.wm.fbx_import(filepath=file)
    else:
        bpy.ops.import_scene.gltf(filepath=file, bone_heuristic="BLENDER", disable_bone_shape=True)
    armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    (mesh,) = (t for t in bpy.data.objects if t.type == "MESH" and t.find_armature() == armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in armature.data.edit_bones:
        bone.use_connect = False  # as an import makes some, which then stay where they are
    bpy.ops.object.mode_set(mode="OBJECT")
    data = armature.animation_data
    for track in list(data.nla_tracks):
        data.nla_tracks.remove(track)
    data.action = None
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()
    still = vertices(mesh, 0)
    data.action = action = bpy.data.actions[name]
    data.action_slot = data.action_slot or action.slots[0]
    first, last = map(round, action.frame_range)
    told = {
        "rate": scene.render.fps,
        "actions": sorted(each.name for each in bpy.data.actions),
        "lengths": {
            each.name: each.frame_range[1] - each.frame_range[0] for each in bpy.data.actions
        },
        "bones": sorted(armature.data.bones.keys()),
        "scale": list(armature.scale),
        "colours": {m.name: colour_of(m) for m in mesh.data.materials},
        "faces": [sum(f.material_index == i for f in mesh.data.polygons) for i in (0, 1)],
    }
    frames = np.array([vertices(mesh, frame) for frame in range(first, last + 1)])
    np.savez(out, still=still, frames=frames, told=json.dumps(told))


def colour_of(material: bpy.types.Material) -> list[float]:
    nodes = material.node_tree.nodes
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    return [round(value, 3) for value in shader.inputs["Base Color"].default_value]


def vertices(mesh: bpy.types.Object, frame: int) -> np.ndarray:
    """Vertices [V, 3] in the scene as the armature moves them."""
    bpy.context.scene.frame_set(frame)
    shown = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    found = np.array([shown.matrix_world @ vertex.co for vertex in shown.to_mesh().vertices])
    shown.to_mesh_clear()
    return found


{"make": make, "see": see}[sys.argv[1]](*sys.argv[2:])
