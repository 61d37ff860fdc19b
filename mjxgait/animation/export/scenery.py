"""What is around a body that grew, in a GLB file: water with particles, sand, and a lamp.

Axes are glTF's: Y up, +Z the way. Letters: `F` key frames, `M` marks.
"""

from collections.abc import Sequence

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.export.gltf import Buffer, add_channel, add_floor
from mjxgait.animation.export.loop import WalkLoop
from mjxgait.animation.export.shaped import material_of, shaped
from mjxgait.animation.export.skeleton import gltf_axes
from mjxgait.animation.export.surface import Surface, ball, disc
from mjxgait.rendering.surroundings import GLOW_COLOUR, SAND, SPECK
from mjxgait.rendering.walk import Walk

PEBBLE = np.array([176, 150, 108.0])
"""Colour of a mark on sand."""
FLAT = 0.25
"""Height of a pebble over its width."""
LAMP_AT = 0.9
"""Farthest place of a lamp in half sizes of a member's space: the light itself is 10 m away."""
GLOW = 2.6
"""Radius of the glow over that of the lamp."""
ROOM = np.array([1.2, 0.9, 2.2])
"""Half sizes of the space with marks about one body, in body lengths: aside, up, ahead."""
PASSING, SCATTERED = 90, 0.25
"""Number of marks in it, and least way of a loop in body lengths for marks to pass."""
MARK, LAMP = 0.012, 0.07
"""Radius of a mark and of a lamp in body lengths."""


def add_scenery(document: gltf.GLTF2, buffer: Buffer, loop: WalkLoop) -> None:
    """Add what passes a walk in place, and its animation: rungs on the floor.

    For a body that grew particles in the water, or pebbles, and the lamp of its task.
    """
    walk = loop.walk
    if not walk.grown:
        add_floor(document, buffer, loop)
        return
    length = float(walk.creature.model.stat.extent)
    times = buffer.add(loop.times[[0, -1]].astype(np.float32), bounds=True)
    _add_passing(document, buffer, loop, length, times)
    lamp = lamp_track(loop, gltf_axes(walk.forward), np.array([0.6, 0.5, 0.9]) * length)
    if lamp is not None:
        node = add_lamp(document, buffer, "lamp", LAMP * length)
        document.scenes[0].nodes.append(node)
        every = buffer.add(loop.times.astype(np.float32), bounds=True)
        add_channel(buffer, document.animations[0], every, node, "translation", lamp)


def _add_passing(
    document: gltf.GLTF2, buffer: Buffer, loop: WalkLoop, length: float, times: int
) -> None:
    """Add marks that pass once around with the loop: each takes the place of the one before.

    times: number of the accessor with the first and the last time.
    """
    water = loop.walk.afloat
    passed = np.array([0.0, loop.climb, loop.advance])
    way = float(np.linalg.norm(passed))
    half, moves = ROOM * length, way > SCATTERED * length
    copies = int(np.ceil(half[2] / way)) if moves else 0
    count = max(PASSING // (2 * copies + 1), 1)
    # One copy fills the space that a loop passes.
    box = np.array([half[0], half[1], way / 2 if moves else half[2]])
    places = places_of_marks(count, box, 0, water)
    ahead = passed / way if moves else np.array([0.0, 0.0, 1.0])
    up = np.cross(ahead, [1.0, 0.0, 0.0])
    places = places @ np.stack([[1.0, 0.0, 0.0], up, ahead])
    shifts = np.arange(-copies, copies + 1)[:, None, None] * passed
    points, normals, faces = mark_surface(MARK * length, water)
    centres = (places + shifts).reshape(-1, 1, 3)
    numbers = len(points) * np.arange(len(centres))[:, None, None]
    surface = (
        (centres + points).reshape(-1, 3),
        np.tile(normals, (len(centres), 1)),
        (numbers + faces).reshape(-1, 3),
    )
    node = _add(document, buffer, "marks", surface, mark_colour(water), glows=water)
    document.scenes[0].nodes.append(node)
    if moves:
        track = np.array([[0.0, 0.0, 0.0], -passed])
        add_channel(buffer, document.animations[0], times, node, "translation", track)


def mark_surface(radius: float, water: bool) -> Surface:
    """Return the surface of a particle, or of a pebble. radius: m."""
    points, normals, faces = ball(radius)
    tall = np.array([1.0, 1.0 if water else FLAT, 1.0])
    turned = normals / tall
    return points * tall, turned / np.linalg.norm(turned, axis=1, keepdims=True), faces


def mark_colour(water: bool) -> np.ndarray:
    """Return the colour [4] of a particle, or of a pebble."""
    return np.append((SPECK if water else PEBBLE) / 255, 1.0)


def add_marks(
    document: gltf.GLTF2, buffer: Buffer, names: Sequence[str], radius: float, water: bool
) -> None:
    """Add particles in water, or pebbles on sand, as nodes of these names, which a page moves.

    radius: m.
    """
    surface = mark_surface(radius, water)
    first = _add(document, buffer, names[0], surface, mark_colour(water), glows=water)
    mesh = document.nodes[first].mesh
    document.nodes += [gltf.Node(name=name, mesh=mesh) for name in names[1:]]


def add_lamp(document: gltf.GLTF2, buffer: Buffer, name: str, radius: float) -> int:
    """Add a lamp with its glow as a node; return its number. radius: m."""
    colour = GLOW_COLOUR / 255
    lamp = _add(document, buffer, name, ball(radius), np.append(colour, 1.0), glows=True)
    glow = np.append(colour, 0.25)
    child = _add(document, buffer, f"{name}_glow", ball(GLOW * radius), glow, glows=True)
    document.nodes[lamp].children = [child]
    return lamp


def add_sand(document: gltf.GLTF2, buffer: Buffer, middle: np.ndarray, radius: float) -> int:
    """Add a plane of sand about a place [3] m as a node; return its number. radius: m."""
    colour = np.append(np.array(SAND[0]) / 255, 1.0)
    sand = _add(document, buffer, "sand", disc(radius), colour, glows=False)
    document.nodes[sand].translation = [float(middle[0]), 0.0, float(middle[2])]
    return sand


def places_of_marks(count: int, half: np.ndarray, seed: int, water: bool) -> np.ndarray:
    """Return places [M, 3] m of marks in a box of these half sizes [3] m; on land on its floor."""
    places = np.random.default_rng(seed).uniform(-half, half, (count, 3))
    return places if water else places * (1, 0, 1)


def lamp_track(loop: WalkLoop, turn: np.ndarray, half: np.ndarray) -> np.ndarray | None:
    """Return the lamp's places [F, 3] m about the body, in the light's direction; None without.

    turn: [3, 3] from MuJoCo's world to the scene. half: half sizes [3] m of the body's space.
    """
    light = light_of(loop.walk)
    if light is None:
        return None
    walk, (first, last) = loop.walk, loop.frames
    frames = np.linspace(first, last, len(loop.qpos)).round().astype(int)
    away = (light - walk.trunk_pos[frames]) @ turn.T
    # As far as the space reaches in this direction, or at the light itself.
    edge = (half / np.maximum(np.abs(away), 1e-9)).min(1, keepdims=True)
    track: np.ndarray = away * np.minimum(LAMP_AT * edge, 1.0)
    return track


def light_of(walk: Walk) -> np.ndarray | None:
    """Return the place [3] m of the task's light in the world; None without."""
    if walk.start is None or not walk.start.light[0].any():
        return None
    place: np.ndarray = walk.trunk_pos[0] + walk.start.light[0]
    return place


def _add(
    document: gltf.GLTF2,
    buffer: Buffer,
    name: str,
    surface: Surface,
    colour: np.ndarray,
    glows: bool,
) -> int:
    """Add a node with a surface of this sRGB colour and opacity [4]."""
    material = material_of(name, colour)
    if glows:
        material.emissiveFactor = material.pbrMetallicRoughness.baseColorFactor[:3]
    document.materials.append(material)
    primitive = shaped(buffer, surface, len(document.materials) - 1)
    document.meshes.append(gltf.Mesh(name=name, primitives=[primitive]))
    document.nodes.append(gltf.Node(name=name, mesh=len(document.meshes) - 1))
    return len(document.nodes) - 1
