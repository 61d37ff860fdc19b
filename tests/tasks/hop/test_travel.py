"""Travelling: a goal that moves on when reached, in evolution and in certification."""

import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from certify_made_up import walk
from tasks.hop.test_hop import ALIKE, HORIZON, REACH, STEP, moment

from mjxgait.certification import CertificateConfig
from mjxgait.certification.acceptance import acceptance_of, promising
from mjxgait.certification.trials import simulate
from mjxgait.creature import Creature
from mjxgait.plugins.registry import build_config
from mjxgait.plugins.user_code import load
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome, Trajectory
from mjxgait.reference.starts import nominal_starts
from mjxgait.tasks.hop import criteria as travel
from mjxgait.tasks.hop.config import (
    GOALS,
    NEAR,
    NOMINAL_GOAL,
    TravelConfig,
)
from mjxgait.tasks.hop.task import Travel, TravelGoal
from mjxgait.tasks.hop.thresholds import TravelThresholds
from mjxgait.training.experiment import build_experiment

CONFIG, DEMANDS = CertificateConfig(), acceptance_of("travel")


def task(creature: Creature) -> Travel:
    return Travel(creature, STEP, HORIZON, creature.settings.termination)


def goal_at(ahead: float, spacing: float) -> TravelGoal:
    return TravelGoal(jnp.float32(ahead), jnp.float32(spacing))


@pytest.mark.parametrize(
    ("forward", "goal"), [(0.0, 1.0), (0.94, 1.0), (0.96, 1.5), (1.2, 1.5), (1.44, 1.5)]
)
def test_a_goal_that_is_near_or_passed_moves_on_by_its_spacing(
    stool: Creature, forward: float, goal: float
):
    """The spacing is 0.5 m, so near means within 2.5 cm."""
    moved = task(stool).next_goal(goal_at(1.0, 0.5), moment(stool, forward + 0.02))
    assert float(moved.ahead) == pytest.approx(goal)
    assert float(moved.spacing) == 0.5


def test_evolution_and_certification_move_goals_alike(stool: Creature):
    rng = np.random.default_rng(0)
    first = rng.uniform(*GOALS, 200)
    goal, way = first * rng.integers(1, 4, 200), rng.uniform(-1, 6, 200)
    theirs = DEMANDS.next_goal(goal, first, way)
    ours = [
        float(task(stool).next_goal(goal_at(g, f), moment(stool, w)).ahead)
        for g, f, w in zip(goal, first, way, strict=True)
    ]
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
    assert 0 < (theirs > goal).sum() < 200


def test_the_goal_of_other_tasks_does_not_move(stool: Creature):
    goal, way = np.array([1.0, 0.4]), np.array([1.0, 3.0])
    for name in ("walk", "hop", "limbo"):
        assert acceptance_of(name).next_goal(goal, goal, way) is goal


def test_fitness_counts_the_way_and_metrics_the_goals(stool: Creature):
    travel, goal = task(stool), goal_at(0.5, 0.5)
    stats, params = travel.init(), travel.params(TravelConfig())
    assert float(travel.outcome(stats)["way"]) == 0
    for forward in (0.0, 0.3, 0.49, 0.8, 1.01, 1.1):
        sensed = moment(stool, forward)
        stats = travel.update(stats, sensed, jnp.zeros(4), params, goal)
        goal = travel.next_goal(goal, sensed)
    told = travel.outcome(stats)
    assert (float(told["goals"]), float(told["way"])) == (2.0, pytest.approx(1.1, abs=1e-6))
    terms = travel.evaluate(stats, TravelConfig())
    assert set(terms) == set(travel.terms)
    assert float(terms["distance"]) == pytest.approx(1 - 1.1 / NOMINAL_GOAL, abs=1e-6)
    far = dataclasses.replace(stats, goal=jnp.float32(9.0), left=jnp.float32(0.3))
    assert float(travel.evaluate(far, TravelConfig())["distance"]) < -6


def test_evolution_and_reference_simulator_move_the_same_goals(
    stool: Creature, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The spacing is a few mm, so that goals are reached within 0.4 s."""
    monkeypatch.setattr(Travel, "goals", (0.004, 0.012))
    monkeypatch.setattr(Travel, "nominal", 0.008)
    file = tmp_path / "reach.py"
    file.write_text(REACH.replace("0.4 * plan", "40.0 * plan"))
    table = {
        "use": {"task": "travel", "controller": load("controller", f"{file}:Reach")},
        "evolution": {"population": 6},
        "rollout": {"seconds": 0.4, "starts": 3, "promote": 1.0, "lanes": 4, **ALIKE},
    }
    experiment = build_experiment(stool, build_config(table, "test"))
    state = experiment.init()
    stats = jax.device_get(jax.jit(experiment.simulate)(state.genomes).stats)
    best = int(stats.reached.sum(1).argmax())
    assert stats.reached[best].max() >= 1
    starts = nominal_starts(stool, 3)
    starts.goal[:] = experiment.starts.goal
    champion = experiment.champion(state, {}, best)
    path = simulate(stool, champion, starts, 0.4).path[:, -2]
    np.testing.assert_allclose((stats.goal - stats.left)[best], path, atol=1e-4)


# Certification


def test_certification_and_evolution_have_the_same_goals():
    acceptance = TravelThresholds()
    assert (acceptance.goals, acceptance.nominal, travel.NEAR) == (GOALS, NOMINAL_GOAL, NEAR)


def way(*places: tuple[float, float]) -> np.ndarray:
    """Distance ahead [T] in m over 22 s, interpolated between (s, m) pairs."""
    return np.interp(np.arange(4400) * STEP, *zip(*places, strict=True))


def recorded(forward: np.ndarray) -> Recording:
    path = np.stack([forward, 0 * forward, 0 * forward + 0.4], 1)
    return dataclasses.replace(walk(), trunk_pos=path, goal=NOMINAL_GOAL)


@pytest.mark.parametrize(
    ("forward", "passes"),
    [
        (way((0, 0), (22, 4.4)), True),
        (way((0, 0), (22, 3.0)), False),
        (way((0, 0), (11, 4.0), (22, 4.5)), False),
        (way((0, 0), (22, -4.0)), False),
        (np.full(4400, np.nan), False),
    ],
    ids=["travels", "slow", "stops", "backwards", "blew up"],
)
def test_criterion_2_requires_steady_progress(forward: np.ndarray, passes: bool):
    assert DEMANDS.second(recorded(forward), CONFIG).passed is passes


def test_the_report_counts_goals():
    report = DEMANDS.report(recorded(way((0, 0), (22, 3.7))), CONFIG)
    assert (report["goals"], report["way"]) == (3, pytest.approx(3.7, abs=1e-3))


def test_disturbed_trials_succeed_if_fast_enough_and_upright(stool: Creature):
    path = np.stack([way((0, 0), (22, end)) for end in (4.0, 3.0, 4.0)])
    film = Trajectory(STEP, *[np.zeros((0, 4400))] * 5)
    clear = np.full(3, np.inf)
    outcome = Outcome(np.array([np.inf, np.inf, 20.0]), np.zeros((3, 2)), path, clear, film)
    starts = DEMANDS.aimed(nominal_starts(stool, 3), CONFIG)
    assert DEMANDS.succeeded(outcome, starts, CONFIG).tolist() == [True, False, False]
    fast = {"way": np.full(2, 0.15 * 8 + 0.01), "seconds": np.full(2, 8.0)}
    assert promising(DEMANDS, fast, 8.0, stool)
    assert not promising(DEMANDS, fast | {"way": np.array([2.0, 1.0])}, 8.0, stool)
