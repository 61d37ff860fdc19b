"""The C peer runs the same episodes as the NumPy peer, which shares none of its code."""

import dataclasses
import shutil

import mujoco
import numpy as np
import pytest
from peers import c_peer, contest
from peers.c_peer import (
    COMPILERS,
    CPeer,
    NoCompiler,
    build,
)
from peers.mujoco_peer import MujocoPeer
from peers.workload import Workload, bare_model

from mjxgait.config.layers import find_creature
from mjxgait.config.schema import Config
from mjxgait.creature import load_creature

TUNING = {
    "threshold": 0.12,
    "period": 0.5,
    "steer": 0.7,
    "pitch": 0.3,
    "pitch_rate": 0.05,
    "roll": 0.4,
    "roll_rate": 0.02,
}


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if not any(map(shutil.which, COMPILERS)):
        pytest.skip("no C compiler is installed")
    return build(tmp_path_factory.mktemp("c"))


def made_up(name: str) -> Workload:
    """Poses that vary so much that some fall; the second start is slippery and pushed."""
    folder, rng, genomes, starts = find_creature(name), np.random.default_rng(0), 6, 2
    creature = load_creature(folder)
    qpos = np.tile(creature.stand_qpos, (starts, 1))
    qpos[1, creature.joints.qpos_adr] += 0.02
    push = np.zeros((starts, creature.model.nv))
    push[1, :2] = 0.3, -0.2
    return Workload(
        folder=folder,
        config=Config(),
        key_poses=creature.joints.stand
        + 0.2 * rng.normal(size=(genomes, 2, len(creature.joints.stand))),
        tuning={name: value * rng.uniform(0.5, 1, genomes) for name, value in TUNING.items()},
        qpos=qpos,
        qvel=0.1 * rng.normal(size=push.shape),
        friction=np.array([1.0, 0.4]),
        push=push,
        push_step=np.array([-1, 30]),
        steps=150,
    )


@pytest.fixture(scope="module")
def walks():
    return made_up("tall_quadruped")


@pytest.mark.parametrize("name", ["tall_quadruped", "duck", "alien"])
def test_the_episodes_equal_those_of_the_numpy_peer(name, library):
    work = made_up(name)
    steps, forward = CPeer(work, 0, 1, library).lap()
    expected_steps, expected_forward = MujocoPeer(work, 0, 1).lap()
    assert steps == expected_steps
    assert forward == pytest.approx(expected_forward, rel=1e-3)


def test_the_clock_gives_the_same_episodes(walks, library):
    law = dataclasses.replace(walks.config.controller, advance="clock")
    work = dataclasses.replace(walks, config=dataclasses.replace(walks.config, controller=law))
    found, expected = CPeer(work, 0, 1, library).lap(), MujocoPeer(work, 0, 1).lap()
    assert found == pytest.approx(expected, rel=1e-3)
    assert found != pytest.approx(CPeer(walks, 0, 1, library).lap(), rel=1e-3)


def test_some_fall_and_every_disturbance_counts(walks, library):
    def forward(**changed: object) -> float:
        return CPeer(dataclasses.replace(walks, **changed), 0, 1, library).lap()[1]

    steps, usual = CPeer(walks, 0, 1, library).lap()
    assert 0 < steps < walks.episodes * walks.steps
    assert forward(friction=np.ones(2)) != pytest.approx(usual, rel=1e-6)
    assert forward(push_step=np.array([-1, -1])) != pytest.approx(usual, rel=1e-6)


def test_shares_add_up_and_laps_repeat(walks, library):
    whole, shares = CPeer(walks, 0, 1, library), [CPeer(walks, i, 2, library) for i in range(2)]
    first = whole.lap()
    assert whole.lap() == first
    assert np.sum([share.lap() for share in shares], axis=0) == pytest.approx(first)


def test_the_bare_model_moves_like_the_whole_model(shipped):
    whole, (bare, watched) = shipped.evolution_model, bare_model(shipped)
    assert bare.ngeom < whole.ngeom
    assert bare.npair
    (qpos, contacts, places), (bare_qpos, bare_contacts, bare_places) = (
        dropped(model, geoms, shipped)
        for model, geoms in ((whole, shipped.feet.watched), (bare, watched))
    )
    assert contacts == bare_contacts > 0
    np.testing.assert_allclose(bare_qpos, qpos, atol=1e-9)
    np.testing.assert_allclose(bare_places, places, atol=1e-9)


def dropped(model, geoms, creature):
    """Pose, contacts and places of geoms after 60 steps without torques."""
    data = mujoco.MjData(model)
    data.qpos[:] = creature.stand_qpos
    data.qvel[:2] = 0.5
    for _ in range(60):
        mujoco.mj_step(model, data)
    return data.qpos.copy(), data.ncon, data.geom_xpos[geoms].copy()


def test_a_model_with_colliding_parts_stays_whole(stool):
    text = stool.files["creature.xml"].replace('conaffinity="2"', 'conaffinity="3"')
    model = mujoco.MjModel.from_xml_string(text)
    settings = dataclasses.replace(
        stool.settings, termination=dataclasses.replace(stool.settings.termination, touch=False)
    )
    same, watched = bare_model(dataclasses.replace(stool, model=model, settings=settings))
    assert same is model
    assert watched is stool.feet.watched


def test_without_a_compiler_the_reason_is_given(walks, monkeypatch):
    monkeypatch.setattr(c_peer.shutil, "which", lambda name: None)
    monkeypatch.setattr(contest, "Workers", lambda *_, **__: "worker")
    peers, left_out = contest._peers(walks)
    assert "c" not in peers
    assert "no C compiler" in left_out["c"]


def test_a_compiler_that_fails_is_quoted(library, tmp_path, monkeypatch):
    wrong = tmp_path / "wrong.c"
    wrong.write_text("int lap(void) { return no_such_thing; }")
    monkeypatch.setattr(c_peer, "SOURCE", wrong)
    with pytest.raises(NoCompiler, match="no_such_thing"):
        build(tmp_path)
