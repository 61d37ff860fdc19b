"""The exported BVH: the same motion as MuJoCo's for any reader."""

import dataclasses

import mujoco
import numpy as np
import pytest
from rendering.made_up import treading

from mjxgait.animation.clips.read_text import POSITION, read_bvh, rig_of_bvh
from mjxgait.animation.export import WalkLoop, build_bvh, walk_loop
from mjxgait.animation.export.skeleton import gltf_axes
from mjxgait.animation.keys import bring
from mjxgait.cli import main
from mjxgait.config.layers import find_creature
from mjxgait.creature import Creature, load_creature
from mjxgait.rendering.walk import record_walk

HALF_A_DEGREE = np.radians(0.5)


@pytest.fixture(scope="module", params=["tall_quadruped", "duck"])
def loop(request: pytest.FixtureRequest) -> WalkLoop:
    creature = load_creature(find_creature(request.param))
    return walk_loop(record_walk(creature, treading(creature, degrees=8.0), 2.5), 30)


def written(loop: WalkLoop, folder, travelling: bool = False):
    file = folder / "walk.bvh"
    file.write_text(build_bvh(loop, travelling))
    return file


def columns(file) -> np.ndarray:
    """Values [F, channels] of a file."""
    text = file.read_text()
    return np.array([line.split() for line in text.split("Frame Time:")[1].splitlines()[1:]], float)


def test_reading_it_back_gives_the_same_angles(loop: WalkLoop, tmp_path):
    creature = loop.walk.creature
    brought = bring(creature, written(loop, tmp_path), tolerance=np.radians(90.0))
    angles = loop.qpos[:, creature.joints.qpos_adr]
    assert np.abs(brought.track.angles - angles).max() < HALF_A_DEGREE
    assert brought.times[1] == pytest.approx(1 / loop.rate)


def test_the_rest_pose_is_the_stand(loop: WalkLoop, tmp_path):
    creature: Creature = loop.walk.creature
    rig = rig_of_bvh(written(loop, tmp_path))
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_kinematics(creature.model, data)
    axes = gltf_axes(loop.walk.forward)
    for name, place in zip(rig.names, rig.places, strict=True):
        at = data.body(name).xpos - data.xpos[creature.trunk]
        assert place == pytest.approx(axes @ at, abs=1e-5)


def test_the_trunk_travels_as_far_as_the_walk_or_stays(loop: WalkLoop, tmp_path):
    here, there = (columns(written(loop, tmp_path, t))[:, :3] for t in (False, True))
    gone = np.linspace(0.0, loop.advance, len(here))
    assert here[-1] == pytest.approx(here[0], abs=1e-5)
    assert there - here == pytest.approx(gone[:, None] * [0.0, 0.0, 1.0], abs=1e-5)


def test_a_turning_walk_follows_a_circle(loop: WalkLoop, tmp_path):
    """A quarter circle to the left: as far to the side as ahead."""
    turning = dataclasses.replace(loop, turned=np.pi / 2)
    here, there = (columns(written(turning, tmp_path, t))[:, :3] for t in (False, True))
    radius = loop.advance / (np.pi / 2)
    end = [here[-1][2] + radius, here[-1][1], radius - here[-1][0]]
    assert there[-1] == pytest.approx(end, abs=1e-5)


def test_no_angle_jumps_by_a_turn(loop: WalkLoop, tmp_path):
    file = written(loop, tmp_path)
    assert np.abs(np.diff(columns(file), axis=0)).max() < 90.0
    assert len(read_bvh(file).times) == len(loop.qpos)
    assert file.read_text().count(POSITION[0]) == 1  # only the trunk moves away


def test_the_command_writes_bvh_by_the_file_ending(stool_run, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["export", str(stool_run), "--out", str(tmp_path / "walk.bvh"), "--travelling"])
    assert not ended.value.code
    assert "walk.bvh" in capsys.readouterr().out
    assert read_bvh(tmp_path / "walk.bvh").names
