"""Water, sand and the light are drawn where the task has them, by both renderers."""

import numpy as np
import pytest
from rendering.grown import grown_walk, leaps, straight

from mjxgait.rendering.floor import BANDS
from mjxgait.rendering.gl import gl_pictures, scene_file, working_backend
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.surroundings import SAND, backdrop, particles, tank
from mjxgait.rendering.walk import Walk

SIZE = (320, 180)


@pytest.fixture(scope="module")
def swimmer() -> Walk:
    return grown_walk("swim", straight(1.0, 0.0, 0.3))


def empty(stage: Stage, frame: int = 0) -> np.ndarray:
    """Picture without bodies."""
    around = backdrop(stage.camera(frame), stage.origin, stage.relief, stage.around)
    return np.asarray(around, int)


def test_water_has_no_stripes_and_is_darker_below(swimmer: Walk):
    stage = Stage([swimmer], *SIZE)
    assert stage.around.water
    rows = np.median(empty(stage), axis=1)
    red, _, blue = rows.T
    assert (blue > red).all()
    assert (np.diff(rows, axis=0) <= 0).all()
    assert rows[0].sum() - rows[-1].sum() > 150
    # Apart from particles a row has one colour.
    assert (np.abs(empty(stage) - rows[:, None]).max(-1) > 2).mean() < 0.02


def test_no_floor_and_no_shadow_of_a_swimmer(swimmer: Walk):
    """Nothing changes but where the body is."""
    stage = Stage([swimmer], *SIZE)
    bare, shown = empty(stage, 50), np.asarray(stage.picture(50), int)
    changed = np.abs(shown - bare).max(-1) > 40
    pixels = stage.camera(50).pixels(stage.participants[0].poses(1.0)[0][1:])
    (left, top), (right, bottom) = pixels.min(0) - 60, pixels.max(0) + 60
    rows, columns = np.nonzero(changed)
    outside = (columns < left) | (columns > right) | (rows < top) | (rows > bottom)
    assert changed.sum() > 500
    # Particles differ a little, and the scale has been drawn.
    assert outside.sum() < 0.004 * changed.size


def test_particles_stand_still_in_the_world(swimmer: Walk):
    """So they pass through the picture as the camera follows the swimmer."""
    stage = Stage([swimmer], *SIZE)
    first, later = stage.camera(40), stage.camera(60)
    seen, again = particles(first), particles(later)
    both = {tuple(p) for p in seen.round(9)} & {tuple(p) for p in again.round(9)}
    assert len(both) > 0.5 * len(seen) > 5
    point = np.array(sorted(both))[0]
    moved = later.pixels(point) - first.pixels(point)
    assert moved == pytest.approx(first.pixels(first.centre) - first.pixels(later.centre))
    assert np.abs(moved).max() > 5
    assert np.abs(np.asarray(tank(first), int) - np.asarray(tank(later), int)).max() > 20


def test_bodies_on_land_stand_on_sand_and_robots_do_not(stool_walk: Walk):
    sandy = Stage([grown_walk("jump", leaps(0.3))], *SIZE)
    grey = Stage([stool_walk], *SIZE)
    assert (sandy.around.bands, grey.around.bands) == (SAND, BANDS)
    assert not sandy.around.water
    red, _, blue = np.median(empty(sandy).reshape(-1, 3), axis=0)
    assert red > blue + 30
    red, _, blue = np.median(empty(grey).reshape(-1, 3), axis=0)
    assert abs(red - blue) < 5


@pytest.mark.parametrize("task", ["follow", "follow-on-land"])
def test_a_light_in_the_picture_shines_at_its_place(task: str):
    stage = Stage([grown_walk(task, straight(1.0, 0.0, 0.0), light=(0.3, 0.1, 0.2))], *SIZE)
    x, y = stage.camera(0).pixels(stage.around.light).astype(int)
    red, green, blue = np.asarray(stage.picture(0), int)[y, x]
    assert (red > 240, green > 210, blue < 160) == (True, True, True)


def test_a_light_outside_the_picture_glows_at_the_edge_on_its_side():
    way = straight(1.0, 0.0, 0.0)
    lit = Stage([grown_walk("follow", way, light=(10.0, 0.0, 0.0))], *SIZE)
    dark = Stage([grown_walk("follow", way)], *SIZE)
    assert dark.around.light is None
    other = np.asarray(lit.picture(10), int) - np.asarray(dark.picture(10), int)
    warmer = other[..., 0] - other[..., 2] > 30
    assert warmer[:, -20:].any()
    assert not warmer[:, :160].any()
    assert not warmer[-10:].any()


def test_gl_gets_the_medium(swimmer: Walk, tmp_path):
    for walk, water in ((swimmer, True), (grown_walk("roam", straight(1.0, 0.0, 0.0)), False)):
        scene_file(Stage([walk], *SIZE), [0, 50], tmp_path / "scene.npz")
        with np.load(tmp_path / "scene.npz") as scene:
            assert bool(scene["water"]) == water
            assert bool(len(scene["bands"])) == (not water)
            assert scene["tint"][0, 0] > scene["tint"][0, 2] or water


def test_gl_draws_the_same_water(swimmer: Walk):
    stage = Stage([swimmer], *SIZE)
    backend, sentence = working_backend(stage)
    if backend is None:
        pytest.skip(f"needs GL (apt: libegl1 and libgl1-mesa-dri, or libosmesa6): {sentence}")
    (gl,) = gl_pictures(stage, [50], backend)
    apart = np.abs(np.asarray(gl, int) - np.asarray(stage.picture(50), int)).max(-1)
    # Bodies are shaded differently; what is around them is not.
    assert (apart < 12).mean() > 0.75
