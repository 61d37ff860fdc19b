"""Several champions in one GLB file, side by side and as large as they are, for a page to move.

The file holds still parts: a node for each body, called `part_` and a number, and each member's
marks and lamp. `School.tracks` holds the motion. Axes are glTF's: Y up, +Z the way of all, +X left.
Letters: `F` key frames, `B` bodies, `M` marks.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.export.bodies import body_mesh, shown_bodies
from mjxgait.animation.export.gltf import Buffer
from mjxgait.animation.export.loop import WalkLoop
from mjxgait.animation.export.scenery import (
    add_lamp,
    add_marks,
    add_sand,
    lamp_track,
    places_of_marks,
)
from mjxgait.animation.export.skeleton import gltf_axes, quaternions
from mjxgait.rendering.painter import seen_geoms
from mjxgait.rendering.shapes import Silhouettes
from mjxgait.rendering.walk import poses_of

AIR = 0.3
"""Free space about a body, in units of its mean size."""
MARKS, SPECK = 16, 0.024
"""Number of marks about each member, and their radius over the least half size of its space."""
SAND = 6.0
"""Radius of the sand over the size of the school."""
FIELD = np.radians(30.0)
"""Vertical angle of view."""
ASPECT = 1.6
"""Width over height of the picture in which all fit."""
WATER_VIEW, LAND_VIEW = (-90.0, 84.0), (-90.0, 58.0)
"""Azimuth and angle from the vertical of the camera in degrees."""


@dataclasses.dataclass(frozen=True, eq=False)
class Track:
    """Motion of one member. bodies: [F, B, 7] m and quaternions (x, y, z, w) about its own middle.

    parts: names of their nodes [B]. lamp: [F, 3] m, None without a light. marks: [M, 3] m at
    the start; they move by `flow` m along Z in a loop and return within `half` [3] m. middle: [3] m
    of its place. seconds: of a loop.
    """

    bodies: np.ndarray
    parts: tuple[str, ...]
    lamp: np.ndarray | None
    marks: np.ndarray
    flow: float
    half: np.ndarray
    middle: np.ndarray
    seconds: float


@dataclasses.dataclass(frozen=True, eq=False)
class School:
    """A scene. target: [3] m that the camera looks at. far: m, its distance. orbit: degrees."""

    glb: bytes
    tracks: tuple[Track, ...]
    target: np.ndarray
    far: float
    orbit: tuple[float, float]


def build_school(loops: Sequence[WalkLoop], water: bool) -> School:
    """Return the scene of these members in their order, line by line as one reads.

    water: a wall of swimmers that are seen from the side; otherwise a field on sand.
    """
    document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator="mjxgait"))
    document.scenes, document.scene = [gltf.Scene(name="gallery", nodes=[])], 0
    buffer = Buffer(document)
    poses = [_poses(loop, water) for loop in loops]
    lows, highs = np.array([ends for _, _, ends in poses]).transpose(1, 0, 2)
    middles, halves = places(highs - lows, water)
    tracks = []
    for number, (loop, (bodies, turn, _)) in enumerate(zip(loops, poses, strict=True)):
        low, high, half = lows[number], highs[number], halves[number]
        # Land creatures keep their height above the sand.
        shift = -(low + high) / 2 * (1, float(water), 1)
        bodies[..., :3] += shift
        parts = _add_parts(document, buffer, loop, number, middles[number])
        lamp = lamp_track(loop, turn, half)
        if lamp is not None:
            add_lamp(document, buffer, f"lamp_{number}", 0.12 * float(half.min()))
        marks = places_of_marks(MARKS, half, number, water)
        names = [f"mark_{number}_{mark}" for mark in range(MARKS)]
        add_marks(document, buffer, names, SPECK * float(half.min()), water)
        way = float(np.hypot(loop.advance, loop.climb)) if water else loop.advance
        seconds = float(loop.times[-1])
        tracks.append(Track(bodies, parts, lamp, marks, way, half, middles[number], seconds))
    low, high = (middles - halves).min(0), (middles + halves).max(0)
    if not water:
        add_sand(
            document, buffer, (low + high) / 2, SAND * float(np.ptp([low, high], axis=0).max())
        )
    inner = {child for node in document.nodes for child in node.children or []}
    document.scenes[0].nodes = [n for n in range(len(document.nodes)) if n not in inner]
    buffer.close()
    orbit = WATER_VIEW if water else LAND_VIEW
    target = (low + high) / 2
    far = distance(middles, halves, target, orbit)
    return School(b"".join(document.save_to_bytes()), tuple(tracks), target, far, orbit)


def places(sizes: np.ndarray, water: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles [N, 3] m of the members' boxes in lines, and the half sizes [N, 3] m.

    sizes: [N, 3] m. Lines lead along Z; in water each is below the one before, on land nearer to
    the camera, which stands at -X. There are as many as fill the picture best.
    """
    orbit = WATER_VIEW if water else LAND_VIEW

    def far(layout: tuple[np.ndarray, np.ndarray]) -> float:
        middles, halves = layout
        target = ((middles - halves).min(0) + (middles + halves).max(0)) / 2
        return distance(middles, halves, target, orbit)

    return min((_lines(sizes, n, water) for n in range(1, len(sizes) + 1)), key=far)


def _lines(sizes: np.ndarray, columns: int, water: bool) -> tuple[np.ndarray, np.ndarray]:
    """Boxes in lines of so many columns; see `places`."""
    boxes = sizes + AIR * sizes.mean()
    across = 1 if water else 0
    line, column = np.divmod(np.arange(len(boxes)), columns)
    wide = np.array([boxes[column == c, 2].max() for c in range(columns)])
    deep = np.array([boxes[line == r, across].max() for r in range(line.max() + 1)])
    middles, halves = np.zeros_like(boxes), boxes / 2
    middles[:, 2] = (np.cumsum(wide) - wide / 2)[column]
    middles[:, across] = -(np.cumsum(deep) - deep / 2)[line]
    halves[:, 2], halves[:, across] = wide[column] / 2, deep[line] / 2
    if not water:
        middles[:, 1] = sizes[:, 1] / 2
    return middles, halves


def distance(
    middles: np.ndarray, halves: np.ndarray, target: np.ndarray, orbit: tuple[float, float]
) -> float:
    """Return the smallest distance in m from which all boxes [N, 3] are in the picture."""
    azimuth, polar = np.radians(orbit)
    towards = np.array(
        [np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)]
    )
    right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
    up = np.cross(towards, right)
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(-1, 3)
    corners = (middles[:, None] + signs * halves[:, None]).reshape(-1, 3) - target
    slope = np.tan(FIELD / 2)
    seen = np.maximum(np.abs(corners @ up) / slope, np.abs(corners @ right) / (ASPECT * slope))
    return float((corners @ towards + seen).max())


def _poses(loop: WalkLoop, water: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses [F, B, 7] of a loop's bodies, the rotation [3, 3] from MuJoCo's world, and the ends
    [2, 3] m of the space that the visible surface needs.

    In water, which has no up, each way leads ahead: a climb is turned.
    """
    model, bodies = loop.walk.creature.model, shown_bodies(loop.walk.creature.model)
    turn = gltf_axes(loop.walk.forward)
    if water and loop.climb:
        rise = np.arctan2(loop.climb, loop.advance)
        c, s = np.cos(rise), np.sin(rise)
        turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ turn
    pos, rot = poses_of(model, loop.qpos, ("xpos", "xmat"))
    turned = turn @ rot[:, bodies]
    quat = np.stack([quaternions(turned[:, b]) for b in range(len(bodies))], axis=1)
    geoms = seen_geoms(model)
    shape, how = poses_of(model, loop.qpos, ("geom_xpos", "geom_xmat"))
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    edge = Silhouettes(model, geoms).outermost(shape[:, geoms] @ turn.T, turn @ how[:, geoms], axes)
    reach = (edge * axes).sum(-1).max((0, 1))
    poses = np.concatenate([pos[:, bodies] @ turn.T, quat], axis=-1)
    return poses, turn, np.stack([-reach[3:], reach[:3]])


def _add_parts(
    document: gltf.GLTF2, buffer: Buffer, loop: WalkLoop, number: int, middle: np.ndarray
) -> tuple[str, ...]:
    """Add a node for each visible body of a member, and return their names."""
    model, names = loop.walk.dressed, []
    for body in shown_bodies(loop.walk.creature.model):
        mesh = body_mesh(document, buffer, model, body)
        name = f"part_{number}_{body}"
        document.nodes.append(gltf.Node(name=name, mesh=mesh, translation=middle.tolist()))
        names.append(name)
    return tuple(names)
