"""Write a Blender rig as a BVH skeleton and as a skinned GLB, at rest.

PYTHON benchmarks/rig_of_blender.py Animals.wolf FOLDER

Needs a Python that has Blender as a module (`pip install bpy`). Kinds are those of Blender's add-on
Rigify: Animals.horse, Basic.basic_quadruped, human, ... These rigs have no skin, so each bone gets
a tube that follows it.
"""

import argparse
import importlib
import math
from pathlib import Path

import bpy
from mathutils import Vector

SIDES, RINGS = 8, (0.1, 0.5, 0.9)
THICK = 0.12
"""Radius of a tube over the length of its bone."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind")
    parser.add_argument("folder", type=Path)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    file = given.folder / given.kind.rpartition(".")[2]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for name in ("rigify", "io_anim_bvh"):
        bpy.ops.preferences.addon_enable(module=name)
    rig = drawn(given.kind)
    bpy.ops.export_anim.bvh(filepath=f"{file}.bvh", frame_start=1, frame_end=2)
    wrapped(rig)
    bpy.ops.export_scene.gltf(
        filepath=f"{file}.glb", export_format="GLB", export_animations=False, export_yup=True
    )


def drawn(kind: str) -> bpy.types.Object:
    """Return the skeleton of a kind, alone in its scene."""
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    rig.select_set(True)
    importlib.import_module(f"rigify.metarigs.{kind}").create(rig)
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig


def wrapped(rig: bpy.types.Object) -> None:
    """Add a mesh of tubes that follows the bones."""
    corners: list[tuple[float, ...]] = []
    faces: list[tuple[int, ...]] = []
    groups: dict[str, range] = {}
    for bone in rig.data.bones:
        first = len(corners)
        corners += tube(bone.head_local, bone.tail_local)
        groups[bone.name] = range(first, len(corners))
        for ring in range(first, len(corners) - SIDES, SIDES):
            turns = [(ring + i, ring + (i + 1) % SIDES) for i in range(SIDES)]
            faces += [(a, b, b + SIDES, a + SIDES) for a, b in turns]
    mesh = bpy.data.meshes.new("skin")
    mesh.from_pydata(corners, [], faces)
    skin = bpy.data.objects.new("skin", mesh)
    for name, places in groups.items():
        skin.vertex_groups.new(name=name).add(list(places), 1.0, "REPLACE")
    skin.parent = rig
    skin.modifiers.new("rig", "ARMATURE").object = rig
    bpy.context.scene.collection.objects.link(skin)


def tube(head: Vector, tail: Vector) -> list[Vector]:
    """Corners of rings about a bone."""
    way = tail - head
    turned = way.to_track_quat("Y", "Z")
    angles = [2 * math.pi * i / SIDES for i in range(SIDES)]
    spokes = [THICK * way.length * Vector((math.cos(a), 0, math.sin(a))) for a in angles]
    return [head + share * way + turned @ spoke for share in RINGS for spoke in spokes]


if __name__ == "__main__":
    main()
