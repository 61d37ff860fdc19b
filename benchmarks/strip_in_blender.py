"""Pictures of an exported walk on a character's own mesh, side by side.

PYTHON benchmarks/strip_in_blender.py WALK.glb OUT.png --frames 6

Needs a Python that has Blender as a module (`pip install bpy`). Lengths are m; Blender has Z up.
"""

import argparse
import math
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

SIZE, SAMPLES = 300, 16
NAME = "walk"
"""How the animation's name begins; a character may have others of its own."""
WIDER = 1.2
"""Width of a picture over the longest side of the character."""
ABOVE = 0.25
"""Height of the camera over its distance."""
SKY, FLOOR = (0.75, 0.8, 0.88, 1.0), (0.5, 0.52, 0.5, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames", type=int, default=6)
    given = parser.parse_args()
    first, last = opened(given.file)
    bpy.context.scene.frame_set(math.floor(first))
    low, high = corners()
    size = high - low
    lit(bpy.context.scene)
    camera = camera_of(bpy.context.scene, WIDER * float(size.max()))
    aside = Vector((1.0, 0.0, 0.0))  # glTF's characters look along +Z, which is Blender's -Y
    pictures = []
    for i in range(given.frames):
        bpy.context.scene.frame_set(math.floor(first + (last - first) * i / given.frames))
        aim(camera, aside, float(size[2]) / 2)
        pictures.append(rendered())
    write(np.concatenate(pictures, axis=1), given.out)


def opened(file: Path) -> tuple[float, float]:
    """Open a file with its walk, and return the first and the last frame of it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(file), disable_bone_shape=True)
    action = next(action for action in bpy.data.actions if action.name.startswith(NAME))
    for thing in bpy.data.objects:
        if data := thing.animation_data:
            for track in list(data.nla_tracks):
                data.nla_tracks.remove(track)
            data.action, data.action_slot = action, action.slots[0]
    first, last = action.frame_range
    return first, last


def corners() -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest coordinates [3] of the meshes in this frame."""
    graph, points = bpy.context.evaluated_depsgraph_get(), []
    for thing in bpy.data.objects:
        if thing.type == "MESH" and thing.vertex_groups:
            shown = thing.evaluated_get(graph)
            mesh = shown.to_mesh()
            own = np.empty(3 * len(mesh.vertices))
            mesh.vertices.foreach_get("co", own)
            way = np.array(shown.matrix_world)
            points.append(own.reshape(-1, 3) @ way[:3, :3].T + way[:3, 3])
            shown.to_mesh_clear()
    found = np.concatenate(points)
    return found.min(0), found.max(0)


def lit(scene: bpy.types.Scene) -> None:
    """Add a floor, a sun and a sky; render on the processor, which needs no display."""
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = SKY
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.0, (0.6, 0.3, 0.4)
    scene.collection.objects.link(sun)
    bpy.ops.mesh.primitive_plane_add(size=200.0)
    floor = bpy.data.materials.new("floor")
    floor.use_nodes = True
    floor.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = FLOOR
    bpy.context.object.data.materials.append(floor)
    scene.render.engine, scene.cycles.samples = "CYCLES", SAMPLES
    scene.cycles.use_denoising = True
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x = scene.render.resolution_y = SIZE


def camera_of(scene: bpy.types.Scene, width: float) -> bpy.types.Object:
    """Add a camera without perspective that is so many metres wide."""
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", width
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def aim(camera: bpy.types.Object, aside: Vector, height: float) -> None:
    """Turn the camera to the character, wherever it has gone."""
    low, high = corners()
    middle = Vector((low + high) / 2)
    middle.z = height
    away = (aside + Vector((0.0, 0.0, ABOVE))).normalized()
    camera.location = middle + 4 * camera.data.ortho_scale * away
    camera.rotation_euler = (middle - camera.location).to_track_quat("-Z", "Y").to_euler()


def rendered() -> np.ndarray:
    """Return the picture [H, W, 4], its lowest row first."""
    with tempfile.TemporaryDirectory() as folder:
        bpy.context.scene.render.filepath = f"{folder}/frame.png"
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(f"{folder}/frame.png")
        return np.array(image.pixels[:]).reshape(SIZE, SIZE, 4)


def write(picture: np.ndarray, file: Path) -> None:
    """Write a picture [H, W, 4] as PNG."""
    height, width, _ = picture.shape
    image = bpy.data.images.new("strip", width, height)
    image.pixels = picture.ravel().tolist()
    image.filepath_raw, image.file_format = str(file.absolute()), "PNG"
    image.save()


if __name__ == "__main__":
    main()
