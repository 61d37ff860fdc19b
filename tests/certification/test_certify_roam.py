"""Acceptance criteria of `roam` and `jump` for modular bodies, on made-up motions."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from certify_made_up import walk

from mjxgait.api import load_creature
from mjxgait.certification import CertificateConfig, outdated
from mjxgait.certification.certificate import schema_of
from mjxgait.creature.geometry import lowest
from mjxgait.reference.grown import Grown, seen_grown
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome, Trajectory
from mjxgait.tasks.modular.criteria import JumpCriteria, RoamCriteria

CONFIG, DEMANDS = CertificateConfig(), RoamCriteria()
FRAMES, STEP, SPEED = 2200, 0.01, 0.4
TIMES = np.arange(FRAMES) * STEP


def roam(
    speed: Any = SPEED,
    rising: float = 0.0,
    tilt: Any = 0.0,
    buried: Any = 0.0,
    folded: Any = 0.0,
) -> Recording:
    """Motion at speeds [T] in m/s. tilt: [T] rad, of the root about its left axis."""
    velocity = np.zeros((FRAMES, 3))
    velocity[:, 1], velocity[:, 2] = speed, rising
    middle, still = np.cumsum(velocity, axis=0) * STEP, np.zeros((FRAMES, 4))
    made, none = walk(), np.zeros((FRAMES, 3))
    tilted = np.broadcast_to(tilt, FRAMES)
    return dataclasses.replace(
        made,
        time_step=STEP,
        trunk_up=np.cos(tilted),
        pitch=tilted,
        roll=np.zeros(FRAMES),
        joint_pos=still,
        joint_vel=np.cos(2 * np.pi * TIMES)[:, None] + still,
        torque=still,
        body_speed=np.full(FRAMES, 1.0),
        overlap=np.zeros((FRAMES, 0)),
        overlap_pairs=(),
        grown=Grown(
            middle,
            momentum=none,
            push=none,
            low=np.zeros(FRAMES),
            buried=np.broadcast_to(buried, FRAMES),
            folded=np.broadcast_to(folded, FRAMES),
            sizes={"part0": 0.1},
        ),
    )


def jump(height: float, until: float = 22.0, since: float = 0.0) -> Recording:
    """Jumps of `height` m in the middle of every two seconds."""
    made = roam()
    assert made.grown
    leaps = (np.abs(TIMES % 2 - 1) < STEP / 2) & (until > TIMES) & (since < TIMES)
    low = np.where(leaps, height, -0.001)
    return dataclasses.replace(made, grown=dataclasses.replace(made.grown, low=low))


def failures(whole: Recording) -> set[int]:
    evaluation = DEMANDS.undisturbed(whole, whole, CONFIG)
    assert sorted(c.number for c in evaluation) == [1, 2, 6, 7, 8, 9]
    return {c.number for c in evaluation if not c.passed}


def test_steady_progress_passes():
    assert not failures(roam())
    assert failures(roam(speed=0.19)) == {2, 6}
    assert failures(roam(speed=np.where(TIMES < 12, 0.6, 0.3))) == {2, 6}


def test_trembling_along_fails():
    made = roam()
    shaken = 0.4 * np.sin(2 * np.pi * 28.0 * TIMES)
    slightly, wildly = (
        dataclasses.replace(made, joint_vel=made.joint_vel + share * shaken[:, None])
        for share in (0.5, 2.0)
    )
    assert not failures(slightly)
    assert failures(wildly) == {7}


def test_rising_is_no_progress():
    assert failures(roam(speed=0.1, rising=1.0)) == {2, 6}


def test_the_tilt_is_limited_from_the_settled_orientation():
    """The limit is 60°."""
    for settled in (0.0, 1.3):
        for tilt, over in ((1.0, False), (1.1, True)):
            tipping = np.where(TIMES < 2.5, settled, settled + tilt * np.sin(TIMES))
            assert (1 in failures(roam(tilt=tipping))) is over, (settled, tilt)
    falling = np.where(TIMES < 1.0, 0.0, 1.5)
    assert not failures(roam(tilt=falling)), "before it has settled it may fall as it likes"


def test_no_block_is_deep_in_the_ground():
    """The limit is 5 % of its size, once the body has settled."""
    moment = np.abs(TIMES - 10) < STEP / 2
    assert failures(roam(buried=np.where(moment, 0.049, 0.0))) == set()
    assert failures(roam(buried=np.where(moment, 0.051, 0.0))) == {9}
    assert failures(roam(buried=np.where(TIMES < 1.9, 0.3, 0.0))) == set()
    assert failures(roam(folded=np.where(moment, 0.049, 0.0))) == set()
    assert failures(roam(folded=np.where(moment, 0.051, 0.0))) == {9}


def test_the_depth_in_the_ground_is_in_block_sizes():
    creature = load_creature("blocks")
    rng, model = np.random.default_rng(0), creature.model
    qpos = np.tile(creature.stand_qpos, (4, 1))
    qpos[:, 3:7] = rng.normal(size=(4, 4))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qpos[:, 2] = [-1.0, 0.0, 0.05, 3.0]
    seen = seen_grown(creature, qpos, np.zeros((4, model.nv)), 0.0)
    data = mujoco.MjData(model)
    for k in range(4):
        data.qpos[:] = qpos[k]
        mujoco.mj_kinematics(model, data)
        assert seen.low[k] == pytest.approx(lowest(model, data))
    assert seen.buried[3] == 0
    least, most = min(seen.sizes.values()), max(seen.sizes.values())
    assert (seen.buried[:2] >= -seen.low[:2] / most).all()
    assert (seen.buried[:2] <= -seen.low[:2] / least).all()


def test_repeated_jumps_pass():
    def failed(whole: Recording, halved: Recording) -> set[int]:
        evaluation = JumpCriteria().undisturbed(whole, halved, CONFIG)
        assert [c.number for c in evaluation] == [2, 6, 8, 9]
        return {c.number for c in evaluation if not c.passed}

    assert not failed(jump(0.11), jump(0.12))
    assert failed(jump(0.09), jump(0.09)) == {2, 6}
    assert failed(jump(0.2), jump(0.15)) == {6}
    assert 2 in failed(jump(0.5, until=2.0), jump(0.2)), "it has to settle first"
    assert 2 in failed(jump(0.15, until=14.0), jump(0.15)), "six of ten, and 0.09 m in the mean"
    assert not failed(jump(0.15, until=16.0), jump(0.12, until=20.0)), (
        "seven, and by finer steps nine"
    )
    told = {"seconds": 8.0, "height": 0.2}
    champion: Any = SimpleNamespace(terms={"height": 9.0}, origin={"nominal": told})
    for later in (0.0, 9.0):
        (again,) = JumpCriteria().kept(champion, jump(0.17, since=later), CONFIG)
        assert again.passed == (later == 0.0), "in as many seconds as evolution saw"


def test_repeated_jumps_from_perturbed_starts_succeed():
    """The jumps: in six of ten spans, in four, in one, and in all but too low."""
    recorded = [jump(0.11, until=14.0), jump(0.11, until=10.0), jump(0.5, until=4.0), jump(0.09)]
    low = np.stack([each.grown.low for each in recorded if each.grown])
    film = Trajectory(STEP, *(np.zeros((0, FRAMES)) for _ in range(5)))
    far, clear = np.zeros((4, 3)), np.full(4, np.inf)
    outcome = Outcome(np.full(4, np.inf), far, np.zeros((4, FRAMES)), clear, film, low=low)
    starts: Any = None
    found = JumpCriteria().succeeded(outcome, starts, CONFIG)
    assert found.tolist() == [True, False, False, False]


def test_certificates_by_earlier_rules_are_outdated():
    for task, version in (("walk", 4), ("hop", 2), ("swim", 4), ("jump", 4), ("follow", 4)):
        assert schema_of(task) == version
        champion: Any = SimpleNamespace(task=task, fingerprint="same")
        document = {"champion": "same", "schema": 2, "task": task}
        creature: Any = SimpleNamespace(terrain="flat")
        assert (outdated(document, champion, creature) is None) == (version == 2), task
