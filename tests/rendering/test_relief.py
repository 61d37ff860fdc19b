"""Uneven ground in pictures and files: drawn in place, and followed by the camera."""

import dataclasses

import mujoco
import numpy as np
import pytest

from mjxgait.animation.export.loop import walk_take
from mjxgait.rendering.floor import draw_floor
from mjxgait.rendering.gl import scene_file
from mjxgait.rendering.gl_worker import _compiled
from mjxgait.rendering.stage import Stage


@pytest.fixture(scope="module")
def climb(stool_walk):
    """The walk on the spot moved ten body lengths up a slope."""
    creature = stool_walk.creature.on("slope:0.2")
    qpos = stool_walk.trajectory.qpos.copy()
    way = np.linspace(0, 10 * creature.frame.body_length, qpos.shape[1])
    qpos[0, :, :2] += way[:, None] * stool_walk.forward
    moved = dataclasses.replace(stool_walk, creature=creature)
    qpos[0, :, 2] += moved.ground_heights(qpos[0, :, :2])
    return dataclasses.replace(
        moved, trajectory=dataclasses.replace(stool_walk.trajectory, qpos=qpos)
    )


def test_facets_of_level_ground_look_like_the_floor(stool_walk):
    stage = Stage([stool_walk], 320, 180)
    camera = stage.camera(0)
    floor, facets = (
        np.asarray(draw_floor(camera, stage.origin, relief), int)
        for relief in (None, lambda x, y: 0.0 * (x + y))
    )
    assert (np.abs(floor - facets).max(2) < 8).mean() > 0.97


def test_the_camera_rises_with_the_ground(climb):
    stage = Stage([climb], 320, 180)
    rows = [
        stage.camera(frame).pixels(climb.trunk_pos[frame])[1] for frame in (0, len(climb.qpos) - 1)
    ]
    assert climb.trunk_pos[-1, 2] > 2 * climb.trunk_pos[0, 2]
    assert rows[1] == pytest.approx(rows[0], abs=40)


@pytest.mark.parametrize(("task", "follows"), [("swim", True), ("walk", False)])
def test_the_camera_rises_with_a_swimmer_but_not_with_a_leap(stool_walk, task: str, follows: bool):
    """A leap from the floor must be visible; a rising swimmer would leave the picture."""
    qpos = stool_walk.trajectory.qpos.copy()
    qpos[0, :, 2] += np.linspace(0, 2, qpos.shape[1])
    risen = dataclasses.replace(
        stool_walk,
        champion=dataclasses.replace(stool_walk.champion, task=task),
        trajectory=dataclasses.replace(stool_walk.trajectory, qpos=qpos),
    )
    stage, ends = Stage([risen], 320, 180), (0, len(risen.qpos) - 1)
    rows = [stage.camera(frame).pixels(risen.trunk_pos[frame])[1] for frame in ends]
    assert (abs(rows[1] - rows[0]) < 40) == follows
    assert 0 < stage.behind(ends[1], 0)[1] < 180, "its label stays in the picture"


def test_uneven_ground_looks_different_from_a_floor(climb):
    stage = Stage([climb], 320, 180)
    camera = stage.camera(len(climb.qpos) - 1)
    drawn = np.asarray(draw_floor(camera, stage.origin, stage.relief), int)
    plane = np.asarray(draw_floor(camera, stage.origin), int)
    assert (np.abs(drawn - plane).max(2) > 8).mean() > 0.2


def test_lanes_of_a_race_have_the_same_ground(climb):
    stage = Stage([climb, climb], 320, 180)
    at = climb.trunk_pos[-1, :2]
    heights = [stage.relief(*(at + lane[:2])) for lane in stage.lanes]
    assert heights == pytest.approx([climb.ground_heights(at[None])[0]] * 2)


def test_the_gl_worker_gets_the_same_ground(climb, tmp_path):
    stage = Stage([climb], 320, 180)
    scene_file(stage, [0, 500], tmp_path / "scene.npz")
    with np.load(tmp_path / "scene.npz") as scene:
        model = _compiled({name: scene[name] for name in scene.files})
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start, down, moving = np.array([0, 0, 50.0]), np.array([0, 0, -1.0]), np.zeros(1, np.int32)
    for frame in (0, 400, 800):
        start[:2] = climb.trunk_pos[frame, :2]
        found = 50 - mujoco.mj_ray(model, data, start, down, None, True, 1, moving, None)
        assert found == pytest.approx(float(stage.relief(*start[:2])), abs=2e-3)


def test_a_file_for_a_viewer_without_ground_stays_at_one_height(climb):
    take = walk_take(climb)
    assert np.ptp(take.qpos[:, 2]) < 0.3 * climb.creature.frame.hip_height
    assert take.advance == pytest.approx(10 * climb.creature.frame.body_length, rel=0.1)
