"""What is around a body that grew, in a GLB file: water with particles, sand, and a lamp.

Axes are glTF's: Y up, +Z the way. Letters: `F` key frames, `M` marks.
"""

from collections.abc import Sequence

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.export.floor import JUMP, add_floor
from mjxgait.animation.export.gltf import Buffer, add_channel
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
PASSING, FADE, LEAST = 70, 0.2, 1e-3
"""Number of marks in it, share of a mark's life in which it grows and vanishes, and least size."""
MARK, LAMP = 0.012, 0.07
"""Radius of a mark and of a lamp in body lengths."""

CELL, CELLS, EACH = 0.9, 1, 3
"""Size in body lengths of a cell of still water, cells to each side, and particles in each."""


def add_scenery(document: gltf.GLTF2, buffer: Buffer, loop: WalkLoop) -> None:
    """Add what passes a walk in place, and its animation: rungs on the floor.

    For a body that grew particles in the water, or pebbles, and the lamp of its task.
    """
    walk = loop.walk
    if not walk.grown:
        add_floor(document, buffer, loop)
        return
    length = float(walk.creature.model.stat.extent)
    _add_passing(document, buffer, loop, length)
    lamp = lamp_track(loop, gltf_axes(walk.forward), np.array([0.6, 0.5, 0.9]) * length)
    if lamp is not None:
        node = add_lamp(document, buffer, "lamp", LAMP * length)
        document.scenes[0].nodes.append(node)
        every = buffer.add(loop.times.astype(np.float32), bounds=True)
        add_channel(buffer, document.animations[0], every, node, "translation", lamp)


def add_still_water(document: gltf.GLTF2, buffer: Buffer, length: float) -> float:
    """Add a block of particles as the node "floor", without motion.

    length: m of the body. Returns the size of a cell in m: moved by it to any side, the block looks
    the same.
    """
    apart = CELL * length
    cells = np.stack(np.meshgrid(*[np.arange(-CELLS, CELLS + 1)] * 3), -1).reshape(-1, 1, 3)
    within = np.random.default_rng(0).uniform(-0.5, 0.5, (EACH, 3))
    places = (apart * (cells + within)).reshape(-1, 3)
    first, names = len(document.nodes), [f"mark_{number}" for number in range(len(places))]
    add_marks(document, buffer, names, MARK * length, water=True)
    for node, place in zip(document.nodes[first:], places, strict=True):
        node.translation = place.tolist()
    children = list(range(first, len(document.nodes)))
    document.nodes.append(gltf.Node(name="floor", children=children))
    document.scenes[0].nodes.append(len(document.nodes) - 1)
    return float(apart)


def _add_passing(document: gltf.GLTF2, buffer: Buffer, loop: WalkLoop, length: float) -> None:
    """Add marks that a body passes: each grows, stays where it is in the world, and vanishes.

    Each lives as long as the loop, and its life begins at a moment of its own, so there is neither
    a seam nor a pattern.
    """
    water = loop.walk.afloat
    names = [f"mark_{number}" for number in range(PASSING)]
    first = len(document.nodes)
    add_marks(document, buffer, names, MARK * length, water)
    document.scenes[0].nodes += range(first, first + PASSING)
    places = places_of_marks(PASSING, ROOM * length, 0, water)
    begins = np.random.default_rng(1).uniform(0.1, 0.9, PASSING)
    passed = np.array([0.0, loop.climb, loop.advance])
    for node, (place, begin) in enumerate(zip(places, begins, strict=True), first):
        times, age = life(begin, float(loop.times[-1]))
        keys = buffer.add(times.astype(np.float32), bounds=True)
        track = place + (0.5 - age)[:, None] * passed
        size = np.clip(np.minimum(age, 1 - age) / FADE, LEAST, 1.0)[:, None] * np.ones(3)
        for path, values in (("translation", track), ("scale", size)):
            add_channel(buffer, document.animations[0], keys, node, path, values)


def life(begin: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return key times [6] in s and a mark's age there, 0 to 1; it begins within the loop."""
    turns = np.sort((begin + np.array([FADE, 1 - FADE])) % 1.0)
    times = seconds * np.sort([0.0, *turns, begin, 1.0])
    at = int(np.searchsorted(times, seconds * begin))
    times = np.insert(times, at, times[at] - JUMP)
    age = (times / seconds - begin) % 1.0
    age[at + 1] = 0.0
    return times, age


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
