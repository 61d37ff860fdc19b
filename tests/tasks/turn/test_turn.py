"""Turning on the spot: fitness terms and acceptance criteria."""

import dataclasses
import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from certify_made_up import walk
from controllers.key_poses.test_stepping import seen
from helpers import SHORT, STOOL, said_by

from mjxgait.certification.acceptance import acceptance_of
from mjxgait.certification.config import CertificateConfig
from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.reference.measure import Recording
from mjxgait.tasks.turn.criteria import AWAY, RATE, TurnCriteria
from mjxgait.tasks.turn.task import Turn, TurnSettings, TurnStats

STEP, STEPS = 0.1, 20
TORQUE = jnp.array([2.0, -2.0, 0.0, 0.0])


def episode(stool: Creature, steps: int = STEPS, turn: float = 0.5, drift: float = 0.0) -> tuple:
    """Statistics and terms after turning at `turn` rad/s and drifting at `drift` m/s."""
    task = Turn(stool, STEP, STEPS, Termination())
    stats: TurnStats = task.init()
    for step in range(steps):
        moment = seen(
            stool,
            trunk_pos=np.add(stool.frame.stand_pos, [drift * STEP * step, 0.0, 0.0]),
            trunk_angvel=np.array([0.0, 0.0, turn]),
            joint_vel=np.ones(4),
        )
        stats = task.update(stats, moment, TORQUE, TurnSettings(), ())
    return task, stats, task.evaluate(stats, TurnSettings(rate=90.0))


def test_a_left_turn_counts_up_to_the_target_rate(stool: Creature):
    assert episode(stool)[2]["turned"] == pytest.approx(np.degrees(0.5) / 90.0, rel=1e-4)
    assert episode(stool, turn=-0.5)[2]["turned"] == pytest.approx(
        -np.degrees(0.5) / 90.0, rel=1e-4
    )
    assert episode(stool, turn=5.0)[2]["turned"] == 1.0


def test_an_early_end_loses_the_remaining_turn(stool: Creature):
    whole, half = episode(stool)[2], episode(stool, steps=STEPS // 2)[2]
    assert half["turned"] == pytest.approx(float(whole["turned"]) / 2, rel=1e-4)
    assert (whole["alive"], half["alive"]) == (1.0, 0.5)


def test_parts_in_each_other_are_penalized(stool: Creature):
    """A crab without this term turned with its legs in its trunk, and failed criterion 9."""
    task, stats, plain = episode(stool)
    deep = dataclasses.replace(stats, overlap=jnp.float32(0.2 * stool.frame.hip_height))
    assert plain["overlap"] == 0.0
    assert 0.5 < task.evaluate(deep, TurnSettings())["overlap"] < 1.0
    assert task.weights(TurnSettings(), jnp.int32(0))["overlap"] == -4.0


def test_distance_from_the_start_is_penalized(stool: Creature):
    """Averaged over the episode, in hip heights."""
    mean = np.mean(0.3 * STEP * np.arange(STEPS))
    found = episode(stool, drift=0.3)
    assert found[2]["away"] == pytest.approx(mean / stool.frame.hip_height, rel=1e-4)
    assert found[0].outcome(found[1])["away"] == pytest.approx(mean, rel=1e-4)
    assert episode(stool)[2]["away"] == 0.0


def test_only_positive_work_counts(stool: Creature):
    """One joint brakes and gives no work back."""
    lifted = stool.frame.mass * 9.81 * stool.frame.hip_height * STEP * STEPS
    assert episode(stool)[2]["work"] == pytest.approx(2.0 * STEP * STEPS / lifted, rel=1e-4)


def turning(rate: float = 40.0, speed: float = 0.0, later: float = 1.0) -> Recording:
    """A made-up turn at `rate` deg/s; `later` scales the rate in the second half."""
    film = walk(speed=speed)
    steps = np.full(len(film.trunk_pos), np.radians(rate) * film.time_step)
    steps[len(steps) // 2 :] *= later
    return dataclasses.replace(film, heading=np.cumsum(steps))


def failed(film: Recording) -> set[str]:
    return {m.name for c in TurnCriteria.criteria(film) for m in c.measures if not m.passed}


def test_a_steady_turn_on_the_spot_passes():
    assert failed(turning()) == set()
    assert failed(turning(rate=RATE + 1)) == set()


@pytest.mark.parametrize(
    ("film", "names"),
    [
        (turning(rate=RATE - 1), {"turn (deg/s)"}),
        (turning(rate=-40.0), {"turn (deg/s)", "second half's turn / first"}),
        (turning(later=0.6), {"second half's turn / first"}),
        (turning(speed=0.36 * (AWAY + 0.1) / 22.0), {"from the start / hip height"}),
        (walk(speed=0.0), {"turn (deg/s)", "second half's turn / first"}),
    ],
    ids=["slow", "to the right", "slows down", "goes away", "never turns"],
)
def test_each_fault_fails_its_measure(film: Recording, names: set[str]):
    assert failed(film) == names


def test_trembling_fails():
    film = turning()
    time = np.arange(len(film.joint_vel)) * film.time_step
    shaken = film.joint_vel.copy()
    shaken[:, 0] += 6.0 * np.sin(2 * np.pi * 28.0 * time)
    shaken = dataclasses.replace(film, joint_vel=shaken)
    assert failed(shaken) == {"buzz of a joint / joint speed"}


def test_validation_starts_at_the_certificates_rate(stool: Creature):
    criteria = acceptance_of("turn")
    outcome = {
        "seconds": np.array([8.0, 8.0, 7.0]),
        "turned": np.radians([8 * RATE + 1, 8 * RATE - 1, 400.0]),
        "away": np.zeros(3),
    }
    assert criteria.managed(outcome, 8.0, stool).tolist() == [True, False, False]


def test_a_short_run_ends_with_a_champion_and_a_certificate(tmp_path: Path, capsys):
    folder, short = tmp_path / "run", tmp_path / "short.toml"
    short.write_text(SHORT)
    small = "--population 6 --generations 1 --rollout.seconds 0.4 --rollout.starts 2"
    rest = "--rollout.promote 1 --rollout.lanes 4 --examination.candidates 0 --no-plots"
    given = ("--env", STOOL, "--task", "turn", *small.split(), *rest.split())
    said_by(capsys, "train", *given, "--out", folder, code=0)
    champion = json.loads((folder / "champion.json").read_text())
    assert set(champion["terms"]) == Turn.counts.keys()
    assert set(champion["origin"]["nominal"]) == set(Turn.outcomes)
    said_by(capsys, "certify", folder, "--config", short, code=0)
    certificate = json.loads((folder / "certificate.json").read_text())
    assert certificate["task"] == champion["task"] == "turn"
    assert certificate["report"]["turn"] > 0.0


def test_the_report_names_the_rate():
    assert TurnCriteria().report(turning(), CertificateConfig())["summary"] == "40 deg/s"
