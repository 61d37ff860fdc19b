"""Acceptance criteria of `swim` and `follow`, on made-up motions."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from certify_made_up import walk

from mjxgait.api import load_creature
from mjxgait.certification import CertificateConfig
from mjxgait.certification.acceptance import Commands
from mjxgait.reference.bodies import Water
from mjxgait.reference.grown import Grown, seen_grown
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome, Trajectory
from mjxgait.tasks.modular.criteria import SwimCriteria
from mjxgait.tasks.modular.follow_criteria import FollowCriteria

CONFIG, DEMANDS = CertificateConfig(), SwimCriteria()
FRAMES, STEP, MASS, SPEED = 2200, 0.01, 10.0, 0.4
TIMES = np.arange(FRAMES) * STEP


def swim(speed: Any = SPEED, aside: Any = 0.0, extra: float = 0.0) -> Recording:
    """Motion at speeds [T] in m/s, driven by the water and by another force of `extra` N."""
    velocity = np.zeros((FRAMES, 3))
    velocity[:, 2], velocity[:, 1] = speed, aside
    middle = np.cumsum(velocity, axis=0) * STEP
    momentum = MASS * velocity
    # Within a stroke it exchanges more momentum with the water than it keeps.
    stroke = 5 * np.sin(2 * np.pi * TIMES)[:, None] * [1.0, 0.0, 0.0]
    momentum += np.cumsum(stroke, axis=0) * STEP - stroke * STEP
    push = np.diff(momentum, axis=0, append=momentum[-1:]) / STEP - extra * np.array([0, 0, 1.0])
    made = walk()
    still = np.zeros((FRAMES, made.joint_vel.shape[1]))
    return dataclasses.replace(
        made,
        time_step=STEP,
        trunk_pos=middle,
        joint_pos=still,
        joint_vel=still,
        torque=still,
        body_speed=np.full(FRAMES, 1.0),
        overlap=np.zeros((FRAMES, 1)),
        overlap_pairs=(("part1", "part3"),),
        grown=Grown(
            middle,
            momentum,
            push,
            low=np.zeros(FRAMES),
            buried=np.zeros(FRAMES),
            folded=np.zeros(FRAMES),
            sizes={"part1": 0.1, "part3": 0.2},
        ),
    )


def failures(whole: Recording, halved: Recording | None = None) -> set[int]:
    evaluation = DEMANDS.undisturbed(whole, halved or swim(), CONFIG)
    assert [c.number for c in evaluation] == [2, 6, 8, 9, 11]
    return {c.number for c in evaluation if not c.passed}


def changed(**values: float) -> Recording:
    """The good motion with other values in one frame."""
    made = swim()
    arrays = {name: np.array(getattr(made, name)) for name in values}
    for name, array in arrays.items():
        array[1000] = values[name]
    return dataclasses.replace(made, **arrays)


def test_a_good_swimmer_passes_in_any_direction():
    assert not failures(swim())
    assert not failures(swim(speed=0.0, aside=SPEED), swim(speed=0.0, aside=SPEED))


@pytest.mark.parametrize(
    "bad",
    [
        swim(speed=0.19),
        swim(speed=0.3 + 1.5 * np.sign(np.sin(2 * np.pi * TIMES))),
        swim(speed=np.where(TIMES < 12, 0.6, 0.3)),
    ],
    ids=["slow", "to and fro", "tired"],
)
def test_a_slow_crooked_or_tiring_swimmer_fails(bad: Recording):
    assert 2 in failures(bad, bad)


def test_half_the_time_step_must_agree():
    assert failures(swim(), swim(speed=SPEED * 1.19)) == set()
    assert failures(swim(), swim(speed=SPEED * 1.21)) == {6}
    assert failures(swim(speed=0.21), swim(speed=0.19)) == {6}


def test_speed_and_torque_have_physical_limits():
    limit = swim().dimensions.torque_limit[0]
    assert failures(changed(joint_vel=19.9)) == set()
    assert failures(changed(joint_vel=20.1)) == {8}
    assert failures(changed(body_speed=5.1)) == {8}
    assert failures(changed(torque=1.01 * limit)) == {8}


def test_no_block_is_deep_in_another():
    """The limit is 5 % of the size of the smaller block."""
    assert failures(changed(overlap=0.0049)) == set()
    assert failures(changed(overlap=0.0051)) == {9}


def test_momentum_from_other_sources_than_the_water_is_found():
    assert failures(swim(extra=0.01)) == set()
    assert failures(swim(extra=0.3)) == {11}


def test_the_speed_in_evolution_must_hold():
    """It must hold over as many seconds as evolution simulated."""
    slower = swim(speed=np.where(TIMES < 10, SPEED, 0.1))
    for told, holds in ((SPEED, True), (1.24 * SPEED, True), (1.3 * SPEED, False)):
        champion: Any = SimpleNamespace(
            terms={"speed": told}, origin={"nominal": {"seconds": 10.0}}
        )
        (kept,) = DEMANDS.kept(champion, slower, CONFIG)
        assert (kept.number, kept.passed) == (10, holds), told
    soon: Any = SimpleNamespace(terms={"speed": 0.4}, origin={"nominal": {"seconds": 1.0}})
    assert not DEMANDS.kept(soon, slower, CONFIG)[0].passed, "ended before anything counted"
    nobody: Any = SimpleNamespace(terms={}, origin={})
    assert not DEMANDS.kept(nobody, slower, CONFIG)[0].passed


def test_a_start_succeeds_in_any_direction():
    """The centre of mass from 2 s on decides, as in criterion 2.

    The travel of the root does not matter.
    """
    ways = 0.21 * np.array([[1, 0, 0], [0, 0, -1], [0, 0, 0.9]])
    late = np.maximum(TIMES - 2.0, 0.0)[None, :, None]
    outcome = disturbed(late * ways[:, None] + np.minimum(TIMES, 2.0)[None, :, None])
    outcome.travel[2] = 100.0
    starts: Any = None
    assert DEMANDS.succeeded(outcome, starts, CONFIG).tolist() == [True, True, False]
    assert DEMANDS.disturbed(0.89, np.nan, CONFIG)[0].passed is False
    assert DEMANDS.disturbed(0.91, np.nan, CONFIG)[0].passed is True


def disturbed(middle: np.ndarray) -> Outcome:
    """Unrecorded simulations [S] with a centre of mass [S, T, 3]."""
    count = len(middle)
    film = Trajectory(STEP, *(np.zeros((0, FRAMES)) for _ in range(5)))
    path, clear = np.zeros((count, FRAMES)), np.full(count, np.inf)
    return Outcome(np.full(count, np.inf), np.zeros((count, 3)), path, clear, film, middle=middle)


def test_follow_is_decided_by_the_centre_of_mass_from_2_s_on():
    """The light is 10 m to the left: 0.11 and 0.09 m/s towards it, 0.11 away from it, upwards."""
    late = np.maximum(TIMES - 2.0, 0.0)[None, :, None]
    ways = np.array([[0, 0.11, 0], [0, 0.09, 0], [0, -0.11, 0], [0, 0, 0.2]])
    outcome = disturbed(late * ways[:, None])
    starts: Any = SimpleNamespace(light=np.tile([0.0, 10.0, 0.0], (4, 1)))
    for drag in (500.0, 0.0):
        found = FollowCriteria(drag).succeeded(outcome, starts, CONFIG)
        assert found.tolist() == [True, False, False, False]


@pytest.mark.parametrize("drag", [500.0, 0.0])
def test_a_light_moves_to_another_side(drag: float):
    criteria = FollowCriteria(drag)
    commands = criteria.commands(CONFIG, STEP, np.random.default_rng(0))
    light, moved = commands.lights["light"], commands.lights["moved_light"]
    np.testing.assert_allclose(np.linalg.norm([light, moved], axis=2), 10.0)
    assert len(commands) == CONFIG.follow.moved
    assert ((light * moved).sum(1) <= 0).all()
    assert commands.seconds == CONFIG.follow.moves + CONFIG.seconds
    assert (light[:, 2] == 0).all() == (moved[:, 2] == 0).all() == (drag == 0)


@pytest.mark.parametrize(
    ("speed", "passes"), [(0.11, True), (0.09, False), (-0.11, False)], ids=str
)
def test_after_the_move_the_light_is_approached_as_fast(speed: float, passes: bool):
    """What comes before 2 s after the move does not count."""
    lights = {"light": np.tile([10.0, 0.0, 0.0], (4, 1))}
    lights |= {"moved_light": np.tile([0.0, 10.0, 0.0], (4, 1)), "light_time": np.full(4, 10.0)}
    times = np.arange(round((10 + CONFIG.seconds) / STEP)) * STEP
    way = np.minimum(times, 12.0)[:, None] * [0.3, -0.3, 0.0]
    way = way + np.maximum(times - 12.0, 0.0)[:, None] * np.array([0.0, speed, 0.0])
    outcome = disturbed(np.tile(way, (4, 1, 1)))
    (criterion,) = FollowCriteria(500.0).obeyed(outcome, Commands(32.0, lights=lights), CONFIG)
    assert (criterion.number, criterion.passed) == (12, passes)
    outcome.fell[:2] = 20.0
    (criterion,) = FollowCriteria(500.0).obeyed(outcome, Commands(32.0, lights=lights), CONFIG)
    assert not criterion.passed, "the episodes of half of them ended early"


def test_the_measured_push_is_the_force_of_the_water():
    """The expected force is that of `Water`, on the initial two blocks in random motion."""
    import mujoco

    creature = load_creature("blocks")
    rng = np.random.default_rng(0)
    qpos = np.tile(creature.stand_qpos, (5, 1)) + rng.uniform(-0.3, 0.3, (5, creature.model.nq))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qvel = rng.normal(size=(5, creature.nv))
    seen = seen_grown(creature, qpos, qvel, 500.0)
    data, water = mujoco.MjData(creature.model), Water(creature.model, 500.0)
    for k in range(5):
        data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
        mujoco.mj_forward(creature.model, data)
        mujoco.mj_subtreeVel(creature.model, data)
        arrays = (data.geom_xpos, data.geom_xmat, data.cvel, data.subtree_com, data.xipos)
        force = water.forces(*(array[None] for array in arrays))[0, :, :3].sum(0)
        np.testing.assert_allclose(seen.push[k], force, rtol=1e-9, atol=1e-9)
        linear = creature.frame.mass * data.subtree_linvel[creature.trunk]
        np.testing.assert_allclose(seen.momentum[k], linear, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(seen.middle[k], data.subtree_com[creature.trunk])
    assert seen.sizes["part0"] == pytest.approx(np.cbrt(0.3 * 0.2 * 0.1))
