"""Several walks in one file, each a stride that begins at the same phase."""

import dataclasses

import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from rendering.made_up import treading

from mjxgait.animation.export import (
    WalkLoop,
    build_clips,
    standing_still,
    stride_in_phase,
    walk_loop,
)
from mjxgait.animation.export.footfalls import footfalls
from mjxgait.animation.export.loop import _straightened
from mjxgait.creature import Creature
from mjxgait.rendering.walk import Walk, record_walk

RATE = 60


@pytest.fixture(scope="module")
def walk(stool: Creature) -> Walk:
    return record_walk(stool, treading(stool, degrees=35.0), 4.0)


@pytest.fixture(scope="module")
def stride(walk: Walk) -> WalkLoop:
    return stride_in_phase(walk, RATE)


def foot_heights(loop: WalkLoop) -> np.ndarray:
    """Heights [F] of the first foot, m, from MuJoCo alone."""
    creature = loop.walk.creature
    data, heights = mujoco.MjData(creature.model), []
    geom = int(creature.feet.watched[0])
    for qpos in loop.qpos:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(creature.model, data)
        heights.append(data.geom_xpos[geom, 2])
    return np.array(heights)


def test_a_stride_begins_where_the_first_foot_comes_down(stride: WalkLoop):
    """Just before, the foot is in the air; at the start it is nearly down."""
    heights = foot_heights(stride)
    low, high = heights.min(), heights.max()
    assert stride.strides == 1
    assert heights[0] < low + 0.4 * (high - low)
    assert heights[-4] > heights[0]


def test_the_stride_is_the_loop_with_another_start(walk: Walk, stride: WalkLoop):
    plain = walk_loop(walk, RATE, most=1)
    assert (stride.qpos[0] == stride.qpos[-1]).all()
    assert stride.advance == plain.advance
    at = int(np.abs(plain.qpos[:-1] - stride.qpos[0]).max(1).argmin())
    np.testing.assert_array_equal(np.roll(plain.qpos[:-1], -at, axis=0), stride.qpos[:-1])


def test_the_footfalls_of_a_stride_begin_where_it_does(walk: Walk, stride: WalkLoop):
    """The first foot comes down at its start, as its height from MuJoCo alone says."""
    plain = footfalls(walk_loop(walk, RATE, most=1))
    own = [fall for fall in footfalls(stride) if fall.foot == 0]
    assert len(own) == 1
    assert min(own[0].down, stride.times[-1] - own[0].down) < 0.05
    assert own[0].down != next(fall.down for fall in plain if fall.foot == 0)
    heights, down = foot_heights(stride), np.zeros(len(stride.qpos) - 1, bool)
    frames = np.arange(np.ceil(own[0].down * RATE), own[0].up * RATE).astype(int)
    down[frames % len(down)] = True
    assert heights[:-1][down].max() < heights[:-1][~down].max()


def test_all_animations_of_a_file_move_the_same_joints(stride: WalkLoop):
    loops = {"idle": standing_still(stride), "walk_020_straight": stride}
    document = gltf.GLTF2.load_from_bytes(build_clips(loops))
    assert [animation.name for animation in document.animations] == list(loops)
    moved = [
        {(channel.target.node, channel.target.path) for channel in animation.channels}
        for animation in document.animations
    ]
    assert moved[0] == moved[1] != set()
    assert len(document.skins) == len(document.meshes) == 1


def on_a_circle(walk: Walk, rate: float, speed: float, times: np.ndarray) -> np.ndarray:
    """The standing pose [F, nq] carried along a circle to the left, facing along it."""
    qpos = np.tile(walk.creature.stand_qpos, (len(times), 1))
    ahead, left = walk.forward, np.array([-walk.forward[1], walk.forward[0]])
    along, aside = np.sin(rate * times) / rate, (1 - np.cos(rate * times)) / rate
    qpos[:, :2] += speed * (along[:, None] * ahead + aside[:, None] * left)
    for row, angle in zip(qpos, rate * times, strict=True):
        about = np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
        mujoco.mju_mulQuat(row[3:7], about, row[3:7].copy())
    return qpos


def test_a_circle_is_straightened(walk: Walk):
    times, rate, speed = 1.0 + np.linspace(0.0, 0.6, 40), np.radians(40.0), 0.5
    straight = _straightened(walk, on_a_circle(walk, rate, speed, times), times, rate)
    way = straight[-1, :2] - straight[0, :2]
    np.testing.assert_allclose(way, speed * 0.6 * walk.forward, atol=1e-3)
    stand = walk.creature.stand_qpos[3:7]
    np.testing.assert_allclose(np.abs(straight[:, 3:7] @ stand), 1.0, atol=1e-4)


def test_a_travelling_turn_leads_along_a_circle(stride: WalkLoop):
    """The root ends at the stride's advance along it, with the stride's turn."""
    turning = dataclasses.replace(stride, advance=0.6, turned=np.radians(30.0))
    document = gltf.GLTF2.load_from_bytes(build_clips({"turn": turning}, travelling=True))
    animation = document.animations[0]
    ends = {}
    for channel in animation.channels:
        if channel.target.node == 0:
            accessor = document.accessors[animation.samplers[channel.sampler].output]
            view, width = document.bufferViews[accessor.bufferView], accessor.count
            bytes_ = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
            ends[channel.target.path] = np.frombuffer(bytes_, np.float32).reshape(width, -1)[-1]
    radius = 0.6 / np.radians(30.0)
    expected = [radius * (1 - np.cos(np.radians(30))), 0.0, radius * np.sin(np.radians(30))]
    np.testing.assert_allclose(ends["translation"], expected, atol=1e-6)
    np.testing.assert_allclose(
        ends["rotation"], [0, np.sin(np.radians(15)), 0, np.cos(np.radians(15))], atol=1e-6
    )
