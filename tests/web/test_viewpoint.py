"""The page's camera stands far enough away for every frame of its loop."""

import re
from importlib import resources

import numpy as np
import pytest
from rendering.framing import corners
from rendering.grown import grown_walk, leaps, straight

from mjxgait.animation.export import viewpoint, walk_take
from mjxgait.animation.export.skeleton import gltf_axes
from mjxgait.animation.export.viewpoint import ASPECT, ORBITS

HALF = np.tan(np.radians(15.0))


def projected(points: np.ndarray, target: np.ndarray, far: float, orbit: np.ndarray) -> np.ndarray:
    """Places [..., 2] in a picture from -1 to 1, by a camera that looks from far m at a point."""
    azimuth, polar = orbit
    flat = np.array([np.sin(azimuth), 0.0, np.cos(azimuth)])
    camera = target + far * (np.sin(polar) * flat + [0.0, np.cos(polar), 0.0])
    into = (target - camera) / far
    right = np.cross(into, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    sight = points - camera
    size = (sight @ into)[..., None] * HALF * [ASPECT, 1.0]
    return np.stack([sight @ right, sight @ np.cross(right, into)], -1) / size


@pytest.mark.parametrize("way", [leaps(0.9), straight(1.0, 0.5, 0.0)])
def test_no_corner_of_any_frame_is_outside_the_page(way: np.ndarray):
    loop = walk_take(grown_walk("jump", way))
    target, far = viewpoint(loop)
    axes = gltf_axes(loop.walk.forward)
    model = loop.walk.creature.model
    points = np.array([corners(model, qpos) for qpos in loop.qpos]) @ axes.T
    for orbit in ORBITS:
        assert np.abs(projected(points, target, far, orbit)).max() < 1.0
    nearer = [np.abs(projected(points, target, far / 2, orbit)).max() for orbit in ORBITS]
    assert max(nearer) > 1.0


def test_the_views_are_those_of_the_page():
    page = (resources.files("mjxgait.web") / "assets" / "page.html").read_text(encoding="utf-8")
    orbits = re.findall(r'data-orbit="(\S+)deg (\S+)deg', page)
    np.testing.assert_allclose(np.radians(np.array(orbits, float)), ORBITS)
