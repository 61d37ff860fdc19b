"""Start and stop clips: simulated motions that fit the clips before and after them."""

import dataclasses

import numpy as np
import pygltflib as gltf
import pytest
from rendering.made_up import falling, treading

from mjxgait.animation.export import WalkLoop, build_clips, stride_in_phase
from mjxgait.certification.trials import simulate
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire.clips import (
    FADES,
    IDLE,
    PLACES,
    RESTS,
    Transition,
    halted,
    start_of,
    stop_of,
    transitions,
)
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.grid import Cell
from mjxgait.reference.changing import HaltingReference
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.walk import Walk, record_walk

RATE = 60


@pytest.fixture(scope="module")
def walk(stool: Creature) -> Walk:
    return record_walk(stool, treading(stool, degrees=35.0), 6.0)


@pytest.fixture(scope="module")
def loops(walk: Walk) -> dict[str, WalkLoop]:
    return {"walk": stride_in_phase(walk, RATE)}


@pytest.fixture(scope="module")
def start(walk: Walk, loops: dict[str, WalkLoop]) -> Transition:
    return start_of(walk, "walk", loops)


@pytest.fixture(scope="module")
def stop(walk: Walk, loops: dict[str, WalkLoop]) -> Transition:
    return stop_of(walk, "walk", loops)


def joints(walk: Walk, qpos: np.ndarray) -> np.ndarray:
    return qpos[..., walk.creature.joints.qpos_adr]


def test_a_start_leads_from_standing_into_the_stride(
    walk: Walk, loops: dict[str, WalkLoop], start: Transition
):
    assert (start.name, start.begins, start.ends) == ("walk_start", IDLE, "walk")
    first, last = joints(walk, start.loop.qpos[[0, -1]])
    np.testing.assert_allclose(first, walk.creature.joints.stand, atol=0.01)
    off = last - joints(walk, loops["walk"].qpos[0])
    assert start.gaps[1] == pytest.approx(np.sqrt((off**2).mean()), abs=1e-3)
    assert max(start.gaps) < 0.05


def test_a_stop_leads_from_the_stride_to_a_stand(
    walk: Walk, loops: dict[str, WalkLoop], stop: Transition
):
    assert (stop.name, stop.begins, stop.ends) == ("walk_stop", "walk", IDLE)
    first, last = joints(walk, stop.loop.qpos[[0, -1]])
    off = first - joints(walk, loops["walk"].qpos[0])
    assert stop.gaps[0] == pytest.approx(np.sqrt((off**2).mean()), abs=1e-3)
    assert stop.gaps[0] < 0.05
    assert np.sqrt(((last - walk.creature.joints.stand) ** 2).mean()) == pytest.approx(stop.gaps[1])
    rests = stop.loop.path[-round(RESTS * RATE) :]
    assert np.abs(rests - rests[-1]).max() < 0.02


def test_the_trunk_position_is_continuous_between_clips(
    loops: dict[str, WalkLoop], start: Transition, stop: Transition
):
    """Relative to the root, which is where the other clip ends or begins."""
    begins = loops["walk"].qpos[0, :2]
    assert np.abs(begins).max() > 1e-3
    first, last = (motion.loop.qpos[:, :2] for motion in (start, stop))
    for found, wanted in ((first[0], 0), (first[-1], begins), (last[0], begins), (last[-1], 0)):
        np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_the_root_of_the_file_moves_with_the_body(
    walk: Walk, loops: dict[str, WalkLoop], start: Transition
):
    """Even in an in-place file, where the root of the walks stands still."""
    frames = round(start.loop.times[-1] / walk.time_step)
    moved = (walk.qpos[frames, :2] - walk.qpos[0, :2]) - loops["walk"].qpos[0, :2]
    np.testing.assert_allclose(start.loop.path[-1], moved, atol=0.005)
    document = gltf.GLTF2.load_from_bytes(build_clips({**loops, "walk_start": start.loop}))
    still, moving = (root_of(document, number) for number in (0, 1))
    assert np.abs(still).max() < 1e-6
    np.testing.assert_allclose(moving[-1, 2], moved @ walk.forward, atol=0.005)
    assert start.entry["way"] == pytest.approx(moved @ walk.forward, abs=0.005)


def test_footfalls_begin_and_end_with_the_stand(start: Transition, stop: Transition):
    """All feet are down while the body stands; the stop's are those of its own simulation."""
    for way, moment in ((start, 0.0), (stop, stop.loop.times[-1] - RESTS)):
        falls, end = way.entry["contacts"], way.entry["duration"]
        assert all(0 <= fall["down"] < fall["up"] <= end + 1e-4 for fall in falls)
        standing = [fall for fall in falls if fall["down"] <= moment + 1e-4 < fall["up"]]
        assert len(standing) == len({fall["foot"] for fall in standing}) == 4
        assert len(falls) > 4, "it steps"
    last = [max(f["up"] for f in falls if f["foot"] == name) for name in {f["foot"] for f in falls}]
    assert last == pytest.approx([end] * 4, abs=1e-3)


def test_the_file_states_the_footfalls_of_starts_and_stops(
    loops: dict[str, WalkLoop], start: Transition, stop: Transition
):
    clips = {**loops, start.name: start.loop, stop.name: stop.loop}
    animations = gltf.GLTF2.load_from_bytes(build_clips(clips)).animations
    for way, animation in zip((start, stop), animations[1:], strict=True):
        assert animation.extras["contacts"] == way.entry["contacts"]
        assert animation.extras["way_m"] == pytest.approx(way.entry["way"], abs=1e-4)
        assert animation.extras["certificate"] == "not examined"


def root_of(document: gltf.GLTF2, number: int) -> np.ndarray:
    """Translations [F, 3] of the first joint in one animation."""
    animation, root = document.animations[number], document.skins[0].joints[0]
    channel = next(
        c for c in animation.channels if (c.target.node, c.target.path) == (root, "translation")
    )
    accessor = document.accessors[animation.samplers[channel.sampler].output]
    view = document.bufferViews[accessor.bufferView]
    begin = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    data = document.binary_blob()[begin : begin + 12 * accessor.count]
    return np.frombuffer(data, np.float32).reshape(-1, 3)


def test_a_commanded_stop_ends_the_walk_in_the_stand(walk: Walk):
    """Each simulation stops at its own moment."""
    stool, halts = walk.creature, np.array([1.0, 1.5, np.inf])
    reference = HaltingReference(stool, walk.champion, walk.time_step, halts, np.full(3, 0.2))
    film = simulate(
        stool,
        walk.champion,
        nominal_starts(stool, 3),
        3.0,
        record=3,
        threads=1,
        reference=reference,
    ).trajectory
    assert np.array_equal(film.target[2], walk.trajectory.target[0, : film.target.shape[1]])
    for row, halt in enumerate(halts[:2]):
        at, after = round(halt / walk.time_step), round((halt + 0.2) / walk.time_step) + 1
        np.testing.assert_array_equal(film.target[row, : at + 1], film.target[2, : at + 1])
        # Balance could still correct the target; this body has none.
        assert np.abs(film.target[row, after:] - stool.joints.stand).max() < 1e-9
        assert np.ptp(film.phase[row, at + 1 :]) == 0


def test_the_earliest_stop_is_chosen(walk: Walk, stop: Transition):
    moments = np.linspace(2.0, 2.4, PLACES)
    motions = halted(walk, moments)
    assert len(motions) == PLACES * len(FADES)
    lasts = [len(motion.qpos) for motion in motions if len(motion.qpos)]
    assert min(lasts) >= (moments[0] + min(FADES)) / walk.time_step
    assert len(set(lasts)) > 1
    assert stop.loop.times[-1] < (max(lasts) - moments[0] / walk.time_step) * walk.time_step


def test_a_fall_gives_no_stop(stool: Creature, walk: Walk):
    fallen = dataclasses.replace(walk, champion=falling(stool))
    assert all(not len(motion.qpos) for motion in halted(fallen, np.linspace(2.0, 2.4, PLACES)))


def test_without_lifted_feet_there_are_no_transitions(stool: Creature, loops: dict[str, WalkLoop]):
    still = record_walk(stool, treading(stool, degrees=4.0), 3.0)
    for made in (start_of(still, "walk", loops), stop_of(still, "walk", loops)):
        assert not made
        assert made.entry["found"] is False


def test_turning_walks_get_no_transitions(loops: dict[str, WalkLoop]):
    cells = [Cell(0.2, 10.0), Cell(0.2, -10.0)]
    found = [Found(cell, True, 0.2, 0.0, 0.5, "trot", 0.3, ()) for cell in cells]
    assert transitions(found, loops) == []
