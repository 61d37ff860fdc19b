"""Several champions in one scene, and what is around a body that grew."""

import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from animation.test_glb import read
from rendering.grown import grown_walk, straight

from mjxgait.animation.export import build_glb, walk_loop
from mjxgait.animation.export.recurrence import most_alike
from mjxgait.animation.export.scenery import lamp_track, life
from mjxgait.animation.export.school import build_school, distance, places
from mjxgait.animation.export.skeleton import gltf_axes

LIGHT = (8.0, 3.0, 1.0)


def names_in(glb):
    """Names of a file's nodes."""
    return [node.name for node in gltf.GLTF2.load_from_bytes(glb).nodes]


@pytest.fixture(scope="module")
def swimmer():
    return walk_loop(grown_walk("follow", straight(2.0, 0.5, 0.6, 300), LIGHT), 25)


@pytest.fixture(scope="module")
def walker():
    return walk_loop(grown_walk("roam", straight(3.0, 0.5, 0.0, 300)), 25)


def test_a_motion_is_a_loop_from_where_it_is_most_alike():
    times = 0.02 * np.arange(500)
    # Once in 1.6 s; a second joint dies away, so early frames are unlike later ones.
    angles = np.stack([np.sin(2 * np.pi * times / 1.6), np.exp(-times)], 1)
    first, last = most_alike(angles, np.tile(np.eye(3).ravel(), (500, 1)), 0.02)
    assert (last - first) * 0.02 % 1.6 == pytest.approx(0.0, abs=1e-9)
    assert first > 150
    assert most_alike(angles[:30], np.zeros((30, 9)), 0.02) is None


def test_a_loop_of_a_swimmer_is_closed_and_about_the_origin(swimmer):
    np.testing.assert_array_equal(swimmer.qpos[0], swimmer.qpos[-1])
    np.testing.assert_allclose(swimmer.qpos[:-1, :3].mean(0), 0.0, atol=1e-9)
    share = swimmer.times[-1] / swimmer.stretched / swimmer.walk.seconds
    assert swimmer.advance == pytest.approx(share * np.hypot(2.0, 0.5), rel=0.02)
    assert swimmer.climb == pytest.approx(share * 0.6, rel=0.02)
    assert swimmer.speed * swimmer.times[-1] == pytest.approx(
        np.hypot(swimmer.advance, swimmer.climb)
    )


@pytest.mark.parametrize("water", [True, False])
def test_poses_are_those_of_mujoco(swimmer, walker, water: bool):
    loop = swimmer if water else walker
    (track,) = build_school([loop], water).tracks
    model = loop.walk.creature.model
    data, ahead = mujoco.MjData(model), np.array([*loop.walk.forward, 0.0])
    for frame in (0, 7):
        data.qpos[:] = loop.qpos[frame]
        mujoco.mj_kinematics(model, data)
        ours, theirs = track.bodies[frame, :, :3], data.xpos[1 : 1 + track.bodies.shape[1]]
        apart = np.linalg.norm(ours[0] - ours, axis=1)
        np.testing.assert_allclose(apart, np.linalg.norm(theirs[0] - theirs, axis=1), atol=1e-9)
        if not water:
            np.testing.assert_allclose(ours[:, 1], theirs[:, 2], atol=1e-9)
            moved = (theirs - theirs[0]) @ ahead
            np.testing.assert_allclose(ours[:, 2] - ours[0, 2], moved, atol=1e-9)


def test_all_swimmers_go_ahead(swimmer):
    """A climb is turned, so the particles pass along one axis, as fast as it swims."""
    (track,) = build_school([swimmer], water=True).tracks
    assert track.flow == pytest.approx(np.hypot(swimmer.advance, swimmer.climb))
    way = np.array([*(swimmer.advance * swimmer.walk.forward), swimmer.climb])
    root = swimmer.walk.creature.model.jnt_qposadr[0]
    about = np.zeros(9)
    mujoco.mju_quat2Mat(about, swimmer.qpos[0, root + 3 : root + 7])
    shown = np.zeros(9)
    mujoco.mju_quat2Mat(shown, np.roll(track.bodies[0, 0, 3:], 1))
    turn = shown.reshape(3, 3) @ about.reshape(3, 3).T
    np.testing.assert_allclose(turn @ way / np.linalg.norm(way), [0, 0, 1], atol=1e-6)


def test_the_file_holds_every_part_mark_and_lamp(swimmer, walker):
    school = build_school([swimmer, swimmer], water=True)
    names = names_in(school.glb)
    for number, track in enumerate(school.tracks):
        assert {*track.parts, f"lamp_{number}", f"mark_{number}_0"} <= set(names)
        assert (np.abs(track.marks) <= track.half).all()
    assert "sand" not in names
    assert "sand" in names_in(build_school([walker], water=False).glb)


@pytest.mark.parametrize("water", [True, False])
def test_no_member_is_in_anothers_place_and_all_are_in_the_picture(water: bool):
    sizes = np.random.default_rng(0).uniform(0.2, 1.0, (11, 3))
    middles, halves = places(sizes, water)
    apart = np.abs(middles[:, None] - middles) - (halves[:, None] + halves)
    assert (apart.max(2)[~np.eye(11, dtype=bool)] > -1e-9).all()
    assert (2 * halves >= sizes - 1e-9).all()
    # Line by line, as one reads: to the right, then down or nearer.
    across = 1 if water else 0
    order = np.lexsort((middles[:, 2], -middles[:, across].round(6)))
    assert list(order) == list(range(11))
    target = ((middles - halves).min(0) + (middles + halves).max(0)) / 2
    far = distance(middles, halves, target, (-90.0, 90.0))
    # From the side, the perspective of the nearest face decides.
    near = far - (target - (middles - halves))[:, 0].max()
    corner = np.abs(middles - target) + halves
    assert (corner[:, 1] <= near * np.tan(np.radians(15)) + 1e-9).all()


def test_a_lamp_stands_where_the_light_is(swimmer, walker):
    half = np.array([0.5, 0.4, 0.6])
    track = lamp_track(swimmer, gltf_axes(swimmer.walk.forward), half)
    assert (np.abs(track) <= half).all()
    light = np.array(LIGHT) + swimmer.walk.trunk_pos[0]
    away = (light - swimmer.walk.trunk_pos[swimmer.frames[0]]) @ gltf_axes(swimmer.walk.forward).T
    np.testing.assert_allclose(
        track[0] / np.linalg.norm(track[0]), away / np.linalg.norm(away), atol=1e-9
    )
    assert lamp_track(walker, np.eye(3), half) is None


@pytest.mark.parametrize("begin", [0.1, 0.5, 0.85])
def test_a_mark_lives_once_around(begin: float):
    times, age = life(begin, 2.0)
    assert (np.diff(times) > 0).all()
    assert times[[0, -1]].tolist() == [0.0, 2.0]
    assert age[0] == pytest.approx(age[-1])
    (born,) = np.flatnonzero(np.diff(age) < 0) + 1
    assert times[born] == pytest.approx(2.0 * begin)
    assert age[born] == 0.0
    assert age[born - 1] == pytest.approx(1.0, abs=1e-3)
    # It is full grown and begins to vanish at keys.
    assert [np.abs(age - share).min() for share in (0.2, 0.8)] == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("water", [True, False])
def test_marks_stand_still_in_the_world(swimmer, walker, water: bool):
    loop = swimmer if water else walker
    document = gltf.GLTF2.load_from_bytes(build_glb(loop, floor=True))
    names = [node.name for node in document.nodes]
    (animation,) = document.animations
    node = names.index("mark_3")
    channels = {c.target.path: c for c in animation.channels if c.target.node == node}
    sampler = animation.samplers[channels["translation"].sampler]
    times, track = (read(document, number) for number in (sampler.input, sampler.output))
    speed = -np.diff(track, axis=0) / np.diff(times, axis=0)
    lives = np.diff(times[:, 0]) > 0.01
    passed = np.array([0.0, loop.climb, loop.advance]) / loop.times[-1]
    np.testing.assert_allclose(speed[lives], np.tile(passed, (lives.sum(), 1)), atol=1e-3)
    size = read(document, animation.samplers[channels["scale"].sampler].output)
    # Nothing is seen of the jump to the beginning of the next life.
    (jump,) = np.flatnonzero(~lives)
    assert size[[jump, jump + 1]].max() < 0.01
    assert size.max() == 1.0
    assert ("lamp" in names) == water
    assert "floor" not in names
