"""A creature as a GLB file with a node for each body, which a page moves as MuJoCo says.

`ground` holds `world`, whose axes are MuJoCo's, and `floor`. Each body is a child of `world` and
is called `body_` and its number: its position and rotation are MuJoCo's `xpos` and `xquat`.
"""

import mujoco
import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.export.floor import add_tiles
from mjxgait.animation.export.gltf import Buffer
from mjxgait.animation.export.scenery import add_still_water
from mjxgait.animation.export.shaped import material_of, shaped
from mjxgait.animation.export.skeleton import gltf_axes, quaternions
from mjxgait.animation.export.surface import Surface, geom_surface
from mjxgait.creature import Creature
from mjxgait.creature.geometry import posed
from mjxgait.reference.layout import start_frame
from mjxgait.rendering.painter import geom_colours, seen_geoms


def shown_bodies(model: mujoco.MjModel) -> list[int]:
    """Return the numbers of the moving bodies that have a visible surface."""
    return sorted({int(model.geom_bodyid[g]) for g in seen_geoms(model)} - {0})


def build_bodies(creature: Creature, model: mujoco.MjModel, afloat: bool) -> tuple[bytes, float]:
    """Return the bytes of the file in the standing pose, and the distance of two tiles in m.

    model: the creature's, with the looks that the file has. afloat: in water; `floor` holds
    particles instead of tiles.
    """
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator="mjxgait"))
    document.scenes, document.scene = [gltf.Scene(name=creature.name, nodes=[0])], 0
    buffer = Buffer(document)
    bodies = shown_bodies(model)
    axes = gltf_axes(start_frame(creature).forward[:2])
    turn = quaternions(axes[None])[0].tolist()
    first = 2
    document.nodes += [
        gltf.Node(name="ground"),
        gltf.Node(name="world", rotation=turn, children=[*range(first, first + len(bodies))]),
    ]
    data = posed(model, creature.stand_qpos)
    for body in bodies:
        place, about = data.xpos[body].tolist(), np.roll(data.xquat[body], -1).tolist()
        mesh = body_mesh(document, buffer, model, body)
        document.nodes.append(
            gltf.Node(name=f"body_{body}", mesh=mesh, translation=place, rotation=about)
        )
    if afloat:
        apart = add_still_water(document, buffer, float(model.stat.extent))
    else:
        apart = add_tiles(document, buffer, creature.frame.body_length)
    document.scenes[0].nodes = [0]
    document.nodes[0].children = [1, len(document.nodes) - 1]
    buffer.close()
    return b"".join(document.save_to_bytes()), apart


def body_mesh(document: gltf.GLTF2, buffer: Buffer, model: mujoco.MjModel, body: int) -> int:
    """Return the number of a new mesh of a body's visible geoms."""
    colours, primitives = geom_colours(model), []
    for geom in seen_geoms(model):
        if model.geom_bodyid[geom] != body:
            continue
        document.materials.append(material_of(f"geom {geom}", colours[geom]))
        surface = _in_body(model, int(geom))
        primitives.append(shaped(buffer, surface, len(document.materials) - 1))
    document.meshes.append(gltf.Mesh(name=f"body {body}", primitives=primitives))
    return len(document.meshes) - 1


def _in_body(model: mujoco.MjModel, geom: int) -> Surface:
    """Surface of a geom in the axes of its body."""
    points, normals, faces = geom_surface(model, geom)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    rotation = turn.reshape(3, 3)
    return points @ rotation.T + model.geom_pos[geom], normals @ rotation.T, faces
