"""The benchmark: all peers do the same work, and its reports keep their format."""

import dataclasses
import importlib.util
import json
import shutil

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import speed
import tyro
from helpers import STOOL, made_up_evaluate, pose_champion, small_config
from peers import c_peer, contest, machine
from peers.machine import count_flops
from peers.mujoco_peer import DampedSolve, Law, MujocoPeer
from peers.ours import as_workload
from peers.scaling import draw
from peers.workload import Lap, Workload, walking

import mjxgait.processes
from mjxgait.config.layers import data_folder, find_creature
from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.reference import READS, PoseReference
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.plugins import resolve_config
from mjxgait.reference.layout import start_frame
from mjxgait.reference.state import State, sense
from mjxgait.training import stages
from mjxgait.training.experiment import build_experiment
from mjxgait.training.generation import next_starts

NEEDS_DART = pytest.mark.skipif(
    importlib.util.find_spec("dartpy") is None, reason="dartpy is not installed"
)
TUNING = {
    "threshold": 0.12,
    "period": 0.8,
    "steer": 0.7,
    "pitch": 0.3,
    "pitch_rate": 0.05,
    "roll": 0.4,
    "roll_rate": 0.02,
}


@pytest.fixture(scope="module")
def creature():
    return load_creature(find_creature("tall_quadruped"))


@pytest.fixture
def workload(creature):
    rng = np.random.default_rng(0)
    genomes, starts, nv = 3, 2, creature.model.nv
    poses = creature.joints.stand + 0.1 * rng.normal(size=(genomes, 2, len(creature.joints.stand)))
    qpos = np.tile(creature.stand_qpos, (starts, 1))
    qpos[1, creature.joints.qpos_adr] += 0.02
    return Workload(
        folder=find_creature("tall_quadruped"),
        config=Config(),
        key_poses=poses,
        tuning={name: np.full(genomes, value) for name, value in TUNING.items()},
        qpos=qpos,
        qvel=np.zeros((starts, nv)),
        friction=np.ones(starts),
        push=np.zeros((starts, nv)),
        push_step=np.array([-1, 10]),
        steps=40,
    )


def test_the_law_equals_the_reference_controller(creature, workload):
    rng, count = np.random.default_rng(1), 5
    champion = pose_champion(creature, workload.key_poses[1], TUNING)
    turn = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    rot = turn * np.sign(np.linalg.det(turn))[:, None, None]
    v, pos = rng.normal(size=(count, creature.model.nv)), rng.normal(size=(count, 3))
    spin = (rot @ v[:, 3:6, None])[..., 0]
    state = State(
        start_frame(creature),
        None,
        np.zeros(count),
        creature.joints.stand + v[:, 6:] * 0.1,
        v,
        pos,
        rot,
        v[:, :3],
        spin,
        *([np.zeros(0)] * 4),
    )
    senses = sense(creature, state, READS)
    position, genome = np.arange(count) * 7, np.full(count, 1)
    law, examiner = Law(creature, workload), PoseReference(creature, champion, 0.005)
    target = law.target(genome, position, pos, rot, v)
    np.testing.assert_allclose(
        target, examiner.target(position, senses, np.zeros(1, int)), atol=1e-12
    )
    expected = examiner.advance(position, target, state.joint_pos, np.ones(count, int))
    np.testing.assert_array_equal(
        law.advance(genome, position, target, state.joint_pos, position), expected
    )


def test_the_damped_solve_equals_the_dense_solve(creature):
    model = creature.evolution_model
    data = mujoco.MjData(model)
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_forward(model, data)
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    dense[creature.joints.dof_adr, creature.joints.dof_adr] += (
        model.opt.timestep * creature.gains.kd
    )
    force = np.arange(model.nv, dtype=float)
    found = DampedSolve(model, creature).solve(data.M[None], force[None])[0]
    np.testing.assert_allclose(found, np.linalg.solve(dense, force), rtol=1e-8)


def test_the_number_of_lanes_changes_nothing(workload):
    few, many = MujocoPeer(workload, 0, 1, lanes=2).lap(), MujocoPeer(workload, 0, 1, lanes=6).lap()
    assert few[0] == many[0] == workload.episodes * workload.steps
    assert few[1] == pytest.approx(many[1])


def test_fallen_episodes_free_their_lanes(workload):
    low = dataclasses.replace(
        workload, qpos=workload.qpos * np.where(np.arange(workload.qpos.shape[1]) == 2, 0.3, 1.0)
    )
    assert MujocoPeer(low, 0, 1, lanes=2).lap() == (0, 0.0)


@NEEDS_DART
def test_dart_walks_the_same_way_at_first(workload):
    from peers.dart_peer import DartPeer

    steps, forward = DartPeer(workload, 0, 1).lap()
    peer_steps, peer_forward = MujocoPeer(workload, 0, 1).lap()
    assert steps == peer_steps
    assert forward / 6 == pytest.approx(peer_forward / 6, abs=0.03)


@NEEDS_DART
def test_dart_names_a_creature_that_it_cannot_rebuild(creature):
    from peers.dart_peer import Unsupported, check_supported

    check_supported(creature)
    with pytest.raises(Unsupported, match="two crossing ones"):
        check_supported(load_creature(find_creature("duck")))


def test_the_benchmark_simulates_all_individuals_on_all_starts(creature):
    """The peers do the same; a run drops the worse individuals after the first start."""
    settings = creature.settings
    assert resolve_config(settings.train, creature.name).rollout.promote < 1
    assert walking(settings).rollout.promote == 1


@pytest.mark.parametrize("generation", [-1, 2])
def test_the_peers_have_the_starts_of_a_lap(stool, generation):
    """With varied starts a run has many more than a generation uses."""
    config = small_config(
        rollout={"starts": 3, "variety": 5}, evolution={"survival": "children", "elite": 0.25}
    )
    experiment = build_experiment(stool, config)
    assert len(experiment.starts.friction) == 11
    state = dataclasses.replace(experiment.init(), generation=jnp.int32(generation))
    work = as_workload(STOOL, experiment, state)
    evaluation = next_starts(experiment.simulator.task, experiment.row, state)
    assert work.episodes == len(work.key_poses) * 3
    for name in ("qpos", "qvel", "friction", "push", "push_step"):
        np.testing.assert_array_equal(getattr(work, name), np.asarray(getattr(evaluation, name)))
    later = 1 + 2 * (generation + 1)
    np.testing.assert_array_equal(work.qpos[1:], experiment.starts.qpos[later : later + 2])


def test_ratios_are_medians_of_rounds():
    laps = {
        "ours": [Lap(1.0, n, 0.0, 2.0) for n in (10, 20, 60)],
        "mujoco_c": [Lap(1.0, 10, 0.0, 6.0)] * 3,
    }
    found = contest._ratios(laps)
    assert found["ratio_over_mujoco_c"] == 2.0
    assert found["ratio_over_dart"] is None
    assert found["ratio_spread"]["mujoco_c"]["highest"] == 6.0
    assert found["processor_ratio"]["mujoco_c"] == 6.0


def test_the_table_has_a_line_per_creature():
    costs = {"ours": {"median": 3.0}, "c": {"median": 9.6}}
    crab = {
        "creature": "crab",
        "processor_us_per_step": costs,
        "processor_ratio": {"c": 3.2},
        "laps": costs,
    }
    head, *lines = contest.ratio_table([crab, crab | {"creature": "duck"}]).splitlines()
    assert head.split()[-2:] == ["ours", "C"]
    assert [line.split() for line in lines] == [
        [name, "3.0", "9.6", "(3.20", "x)"] for name in ("crab", "duck")
    ]


def test_flops_of_loops_and_products():
    x = jnp.ones((4, 3))
    assert count_flops(lambda a: a @ a.T + 1.0, x) == 2 * 16 * 3 + 16
    assert count_flops(lambda a: jax.lax.fori_loop(0, 5, lambda _, b: b * 2.0, a), x) == 60


def test_the_curves_are_drawn(tmp_path):
    point = {
        "population": 32,
        "lanes": 64,
        "useful_steps_per_second": 1.0,
        "computed_steps_per_second": 2.0,
        "memory_mib": 3.0,
    }
    draw({"population": [point], "lanes": [point]}, tmp_path / "curves.png")
    assert (tmp_path / "curves.png").stat().st_size > 1000


def test_history_has_a_line_per_run(tmp_path):
    result = dict.fromkeys(
        (
            "date",
            "ratio_over_mujoco_c",
            "ratio_over_dart",
            "creature_steps_per_second",
            "processor_us_per_step",
            "creature",
            "ratio_over_c",
        ),
        1,
    )
    result |= dict.fromkeys(("compile_s", "useful_share", "machine", "versions", "laps"), 2)
    for _ in range(2):
        contest.append_history(result, tmp_path / "new" / "history.jsonl")
    lines = [
        json.loads(line)
        for line in (tmp_path / "new" / "history.jsonl").read_text(encoding="utf-8").splitlines()
    ]
    assert len(lines) == 2
    assert "laps" not in lines[0]
    assert lines[0]["ratio_over_c"] == 1


def run(arguments: list[str]) -> None:
    """Measure as the script does."""
    speed.compare(tyro.cli(speed.SpeedOptions, args=arguments))


def made_up_result(folder, options):
    """Result of a contest, without running one."""
    costs = {"ours": {"median": 3.0}, "c": {"median": 9.0}}
    return {
        "creature": folder.name,
        "ratio_over_c": 2.9,
        "ratio_over_dart": None,
        "creature_steps_per_second": costs,
        "processor_us_per_step": costs,
        "processor_ratio": {"c": 3.0},
        "limit": {"share_of_bound": {"flops": 0.1, "cache_bytes": 0.5}},
        "left_out": {"dart": "not installed"},
        "laps": costs,
    }


def test_the_command_measures_several_creatures(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(speed, "_measured", made_up_result)
    file, history = tmp_path / "bench.json", tmp_path / "history.jsonl"
    asked = ["--json", str(file), "--history", str(history), "--env", "duck", "alien"]
    run(asked)
    found = json.loads(file.read_text(encoding="utf-8"))
    assert list(found["ratios"]) == list(found["creatures"]) == ["duck", "alien"]
    assert found["ratios"]["alien"] == {"ratio_over_c": 2.9, "ratio_over_dart": None}
    kept = [json.loads(line)["creature"] for line in history.read_text().splitlines()]
    assert kept == ["duck", "alien"]
    said = capsys.readouterr().out
    assert "DART           left out: not installed" in said
    assert [line.split()[0] for line in said.splitlines()[-3:-1]] == ["duck", "alien"]


def test_all_means_every_shipped_creature_except_modular_ones(tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "_measured", made_up_result)
    run(["--json", str(tmp_path / "bench.json"), "--env", "all"])
    found = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
    shipped = {path.name for path in data_folder("envs").iterdir()}
    assert list(found["ratios"]) == sorted(shipped - {"blocks"})


def test_the_result_of_one_creature_is_written_unchanged(tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "_measured", made_up_result)
    run(["--json", str(tmp_path / "bench.json")])
    found = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
    assert found == made_up_result(find_creature("tall_quadruped"), None)


def test_the_curves_need_a_single_creature(tmp_path):
    with pytest.raises(UserError, match="--scaling measures one creature"):
        run(["--json", str(tmp_path / "b.json"), "--env", "all", "--scaling"])


MADE_UP_COST = {"flops_asked": 2.0, "flops": 3.0, "bytes": 5.0, "state_bytes": 1.0}
"""Cost per step; the true cost needs another compilation of the step."""


@pytest.fixture
def unsimulated(monkeypatch):
    """No simulation, so that only evolution is compiled; the peers run on one core."""
    monkeypatch.setattr(stages, "evaluate", made_up_evaluate)
    monkeypatch.setattr(contest, "step_cost", lambda experiment: MADE_UP_COST)
    for module in (contest, machine, c_peer, mjxgait.processes):
        monkeypatch.setattr(module, "cores", lambda: 1)


SIMULATED = pytest.mark.thorough("compiles the whole; each part has tests of its own")


@pytest.mark.slow
@pytest.mark.thorough("evolves, and starts the rivals; each part has tests of its own")
@pytest.mark.parametrize(
    "simulated", [False, pytest.param(True, marks=SIMULATED)], ids=["made up", "simulated"]
)
def test_the_command_writes_the_ratios(tmp_path, request, simulated):
    """The starts vary by generation, as for the shipped bodies."""
    if not simulated:
        request.getfixturevalue("unsimulated")
    file, body = tmp_path / "bench.json", tmp_path / "body"
    shutil.copytree(STOOL, body)
    with (body / "creature.toml").open("a", encoding="utf-8") as settings:
        settings.write('\n[train]\nbase = "other_starts"\nrollout = { seconds = 1.0 }\n')
    arguments = [
        *("--json", file, "--env", body),
        *("--rounds", 1, "--generations", 1, "--population", 8),
    ]
    run([str(word) for word in arguments])
    found = json.loads(file.read_text(encoding="utf-8"))
    assert found["ratio_over_mujoco_c"] > 0
    assert found["workload"]["starts"] == walking(load_creature(body).settings).rollout.starts
    assert (found["ratio_over_c"] is None) == ("c" in found["left_out"])
    ours, theirs = (found["laps"][name][0]["steps"] for name in ("ours", "mujoco_c"))
    if simulated:
        assert ours == pytest.approx(theirs, rel=0.1)
    else:  # one step of each episode, all steps of the peers
        assert 0 < ours < theirs
    assert (found["ratio_over_dart"] is None) == ("dart" in found["left_out"])
