"""The camera keeps the whole body in the picture, in all frames of a clip."""

import mujoco
import numpy as np
import pytest
from rendering.framing import corners
from rendering.grown import STEP, grown_walk, leaps, straight

from mjxgait.rendering.floor import VIEWS
from mjxgait.rendering.gl import scene_file
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import Walk

WAYS = {
    "straight up": ("swim", straight(0.0, 0.0, 4.0)),
    "aside and down": ("swim", straight(-1.0, 2.0, -0.8)),
    "a dash": ("swim", np.repeat([[0.0, 0.0, 0.0], [2.0, 0.0, 1.5]], 50, 0)),
    "leaps": ("jump", leaps(0.8)),
    "walks": ("roam", straight(0.5, -1.5, 0.0)),
}
SIZE = np.array([320, 180])


@pytest.mark.parametrize("view", [None, *VIEWS])
@pytest.mark.parametrize("way", WAYS)
def test_no_corner_of_any_frame_is_outside_the_picture(way: str, view: str | None):
    task, path = WAYS[way]
    walk = grown_walk(task, path)
    stage = Stage([walk], *SIZE, view)
    pixels = np.array(
        [
            stage.camera(frame).pixels(corners(walk.creature.model, qpos))
            for frame, qpos in enumerate(walk.qpos)
        ]
    )
    assert stage.frames == len(walk.qpos)
    assert pixels.min() > 2
    assert (pixels < SIZE - 2).all()
    # Nor is it a dot: no camera stands farther away than the whole way needs.
    assert (np.ptp(pixels, axis=(0, 1)) / SIZE).max() > 0.6


def test_gl_draws_what_the_stage_shows(tmp_path):
    """Poses and cameras of its input have all corners in the picture too."""
    walk = grown_walk(*WAYS["a dash"])
    stage, frames = Stage([walk], *SIZE), range(0, 100, 9)
    scene_file(stage, frames, tmp_path / "scene.npz")
    with np.load(tmp_path / "scene.npz") as scene:
        poses, centres, extent = scene["qpos"], scene["centre"], float(scene["extent"])
    assert extent == pytest.approx(SIZE[1] / stage.scale)
    for frame, (pose,), centre in zip(frames, poses, centres, strict=True):
        camera = stage.camera(frame)
        np.testing.assert_allclose(centre, camera.centre)
        pixels = camera.pixels(corners(walk.creature.model, pose))
        assert pixels.min() > 0
        assert (pixels < SIZE).all()


def test_bodies_that_grew_go_to_the_right(tmp_path):
    """A race turns each about its start, in the painter and in the input of GL."""
    walks = [grown_walk("roam", straight(*way, 0.0)) for way in ((0.0, -2.0), (-1.5, 0.5))]
    stage = Stage(walks, *SIZE)
    scene_file(stage, [0, 99], tmp_path / "scene.npz")
    with np.load(tmp_path / "scene.npz") as scene:
        first, last = scene["qpos"]
    for place, participant in enumerate(stage.participants):
        went = participant.trunk(99 * STEP) - participant.trunk(0.0)
        assert went @ stage.left == pytest.approx(0.0, abs=1e-9)
        assert went[:2] @ stage.forward == pytest.approx([2.0, np.hypot(1.5, 0.5)][place])
        np.testing.assert_allclose((last - first)[place, :3], went, atol=1e-9)
        pos, _ = participant.poses(0.0)
        data = mujoco.MjData(walks[place].shown)
        data.qpos[:] = first[place]
        mujoco.mj_kinematics(walks[place].shown, data)
        lane = stage.lanes[place]
        np.testing.assert_allclose(data.geom_xpos[1:], pos[1:] + lane, atol=1e-9)


def test_a_body_that_stays_in_the_picture_moves_no_camera(stool_walk: Walk):
    """The usual view has its room already."""
    stage = Stage([stool_walk], *SIZE)
    seen = stage.camera(0).pixels(stage.participants[0].outline)
    # `Stage` leaves 35 percent around the standing body, at the bottom and the top or at the sides.
    assert (np.ptp(seen, axis=0) / SIZE).max() == pytest.approx(1 / 1.35)
