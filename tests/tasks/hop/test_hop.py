"""Hopping to a goal: goals of the trials, episode statistics, and fitness terms."""

import dataclasses
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SHORT, altered, pose_champion, said_by

from mjxgait.certification import record
from mjxgait.certification.trials import simulate
from mjxgait.config.layers import find_creature
from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import EvolutionState
from mjxgait.plugins import resolve_config
from mjxgait.plugins.registry import build_config
from mjxgait.plugins.user_code import load
from mjxgait.reference.starts import nominal_starts
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.hop.config import (
    GOALS,
    NOMINAL_GOAL,
    HopConfig,
    HopWeights,
)
from mjxgait.tasks.hop.fitness import STYLE, TERMS, fitness_terms, signed_weights, terms_under
from mjxgait.tasks.hop.stats import HopStats, away, empty, goal_distance, rested, updated
from mjxgait.tasks.hop.task import Hop
from mjxgait.tasks.starts import Starts, draw_starts
from mjxgait.tasks.walk.config import WalkConfig
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.types import Sensed

STEP, HORIZON = 0.005, 1000


@pytest.fixture(scope="module")
def luxo() -> Creature:
    return load_creature(find_creature("luxo"))


def moment(creature: Creature, forward: float = 0.0, aside: float = 0.0, **other: object) -> Sensed:
    """The standing body, moved ahead and to the left of the start, in m."""
    ahead, left = creature.frame.start_axes
    still = jnp.zeros(3)
    values = {
        "joint_pos": jnp.float32(creature.joints.stand),
        "joint_vel": jnp.zeros(len(creature.joints.stand)),
        "bias": jnp.zeros(creature.nv),
        "trunk_pos": jnp.float32(creature.frame.stand_pos + forward * ahead + aside * left),
        "trunk_rot": jnp.float32(creature.frame.stand_rot),
        "trunk_vel": still,
        "trunk_angvel": still,
        "geom_pos": jnp.zeros((len(creature.feet.watched), 3)),
        "geom_low": jnp.ones(len(creature.feet.watched)),
    }
    return Sensed(**(values | other))


# Goals


def trials(creature: Creature, count: int) -> tuple[Starts, Starts]:
    """Trials of hop, and of any other task with the same key."""
    key, settings = key_of(3), RolloutConfig(starts=count)
    task = Hop(creature, STEP, HORIZON, creature.settings.termination)
    return task.trials(key, creature, settings), draw_starts(key, creature, settings)


def test_trials_have_distinct_goals_starting_with_the_nominal(stool: Creature):
    goals = np.asarray(trials(stool, 200)[0].goal)
    assert goals[0] == np.float32(NOMINAL_GOAL)
    assert len(set(goals.tolist())) == 200
    low, high = GOALS
    assert low <= goals.min() < low + 0.05
    assert high - 0.05 < goals.max() <= high


def test_hop_trials_differ_from_other_tasks_only_in_their_goals(stool: Creature):
    hop, plain = trials(stool, 5)
    assert plain.goal is None
    for name in {field.name for field in dataclasses.fields(Starts)} - {"goal"}:
        np.testing.assert_array_equal(getattr(hop, name), getattr(plain, name), err_msg=name)


def test_goal_distance_is_along_the_starts_forward_axis(stool: Creature):
    goal = jnp.float32(1.0)
    for forward, aside, left in (
        (0.3, 0.0, 0.7),
        (0.3, 0.5, 0.7),
        (-0.2, 0.0, 1.2),
        (1.4, 0, -0.4),
    ):
        value = goal_distance(stool, goal, moment(stool, forward, aside))
        assert float(value) == pytest.approx(left, abs=1e-6)


# The statistics


def after(creature: Creature, moments: list[Sensed], goal: float = 1.0) -> HopStats:
    stats = empty(creature, HORIZON)
    for sensed in moments:
        stats = updated(creature, STEP, stats, sensed, jnp.float32(goal))
    return jax.device_get(stats)


def test_arrival_is_the_first_step_near_the_goal(stool: Creature):
    way = [0.0, 0.5, 0.94, 0.96, 1.2, 1.0]
    stats = after(stool, [moment(stool, forward) for forward in way])
    assert (stats.steps, stats.arrived) == (6, 3)
    assert stats.left == pytest.approx(0.0, abs=1e-6)
    assert after(stool, [moment(stool, 0.5)] * 6).arrived == HORIZON


def test_a_body_beside_the_goal_has_not_arrived(stool: Creature):
    """The distance is in the plane; a sideways step can undo an arrival or complete one."""
    beside = after(stool, [moment(stool, 1.0, 0.3)])
    assert beside.arrived == HORIZON
    assert float(away(beside)) == pytest.approx(0.3, abs=1e-6)
    assert float(away(after(stool, [moment(stool, 0.6, -0.3)]))) == pytest.approx(0.5, abs=1e-6)
    assert after(stool, [moment(stool, 1.0, 0.3), moment(stool, 1.0, 0.04)]).arrived == 1


def test_the_arrival_radius_scales_with_the_goal_distance(stool: Creature):
    assert after(stool, [moment(stool, 1.91)], goal=2.0).arrived == 0
    assert after(stool, [moment(stool, 0.37)], goal=0.4).arrived == HORIZON


@pytest.mark.parametrize("place", [(1.9, 0.0), (2.1, 0.0), (2.0, 0.1), (2.06, -0.08)])
def test_the_final_error_is_reported_in_m_and_as_a_share(stool: Creature, place):
    task = Hop(stool, STEP, HORIZON, stool.settings.termination)
    outcome = task.outcome(after(stool, [moment(stool, *place)], goal=2.0))
    assert float(outcome["left"]) == pytest.approx(0.1, abs=1e-6)
    assert float(outcome["off"]) == pytest.approx(0.05, abs=1e-6)


def test_motion_after_the_arrival_is_counted(stool: Creature):
    fast = jnp.array([0.3, 0.0, 0.4])
    way = [moment(stool, forward, trunk_vel=fast) for forward in (0.0, 0.5, 1.0, 1.0, 0.7, 1.0)]
    assert after(stool, way).after == pytest.approx(3 * STEP * 0.5)


def test_ground_contact_counts_every_step_it_lasts(stool: Creature):
    feet = len(stool.feet.foot_of)
    lies = moment(stool, geom_low=jnp.ones(len(stool.feet.watched)).at[feet].set(-0.001))
    steps = moment(stool, geom_low=jnp.ones(len(stool.feet.watched)).at[0].set(-0.001))
    assert after(stool, [lies, steps, lies]).ground == 2


def test_only_the_final_posture_counts(stool: Creature):
    bent = moment(stool, joint_pos=jnp.float32(stool.joints.stand + np.array([0.1, -0.2, 0, 0.3])))
    assert after(stool, [moment(stool), bent]).bent == pytest.approx([0.1, 0.2, 0, 0.3], abs=1e-6)
    assert not after(stool, [bent, moment(stool)]).bent.any()


def test_the_fastest_joint_speed_of_the_episode_counts(stool: Creature):
    speeds = [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -3.0, 0.0], [2.0, 0.0, 0.0, 0.0]]
    turning = [moment(stool, joint_vel=jnp.array(speed)) for speed in speeds]
    assert after(stool, turning).fastest == 3.0


MOVING = (
    {"trunk_vel": [0, 0.01, 0]},
    {"trunk_angvel": [0, 0, 0.1]},
    {"joint_vel": [0, -0.1, 0, 0]},
)


@pytest.mark.parametrize("motion", MOVING)
def test_an_episode_ends_after_resting_long_enough(stool: Creature, motion: dict):
    moves = moment(stool, **{name: jnp.float32(value) for name, value in motion.items()})
    rests, touching, never = jnp.float32(3), jnp.bool_(True), jnp.float32(0)
    still = [moment(stool)] * 3
    for moments, steps in (
        ([*still, moves], 4),
        ([moves, *still], HORIZON),
        ([*still[:2], moves, *still[:2]], 5),
    ):
        stats = after(stool, moments)
        ended = rested(stats, HORIZON, rests, touching)
        assert (ended.steps, ended.ground) == (steps, steps - len(moments))
        assert rested(stats, HORIZON, never, touching).steps == len(moments)
        assert rested(stats, HORIZON, rests, ~touching).ground == 0


# The terms

HALF_WAY = {"steps": 1000, "goal": 1.6, "left": 0.8}
THERE = HALF_WAY | {"left": 0.0}

CASES: list[tuple[str, float, dict]] = [
    ("distance", 0.5, HALF_WAY),
    ("distance", 0.5, HALF_WAY | {"left": -0.8}),
    ("distance", 1.0, {}),
    ("distance", 2.0, HALF_WAY | {"left": 9.0}),
    # Distance in the plane: 0.3, 0.4 and 0.5 form a right triangle.
    ("distance", 0.5, {"goal": 1.0, "left": 0.3, "aside": -0.4}),
    # Full penalty beyond 5 % of the goal's distance, half of it at half of that.
    ("missed", 1.0, {}),
    ("missed", 1.0, HALF_WAY | {"left": 0.09}),
    ("missed", 0.5, HALF_WAY | {"left": -0.04}),
    ("missed", 0.5, THERE | {"aside": 0.04}),
    ("time", 1.0, THERE),
    ("time", 0.25, THERE | {"arrived": 250}),
    ("restless", 0.5, THERE | {"after": 0.8}),
    ("restless", 1.0, THERE | {"after": 8.0}),
    ("ground", 0.3, THERE | {"ground": 300.0}),
    ("ground", 0.6, THERE | {"ground": 300.0, "steps": 500}),
    ("fall", 1.0, THERE | {"reason": int(Reason.TIPPED)}),
    ("fall", 0.0, THERE),
    # The limit is 14 rad/s of a maximum of 20 rad/s.
    ("fast", 0.0, THERE | {"fastest": 13.9}),
    ("fast", 0.5, THERE | {"fastest": 17.0}),
    ("fast", 1.0, THERE | {"fastest": 50.0}),
    # Half of a pose range of 80 degrees is 0.698 rad.
    ("neutral", 0.25, THERE | {"bent": [np.radians(40), 0.0, 0.0, 0.0]}),
    # 0.05 hip heights beyond the 0.005 allowed for parts that only touch
    ("overlap", 0.5, THERE | {"overlap": 0.055 * 0.5}),
    # 3 times the weight of 2 kg over the distance, at least a quarter of a body length
    ("energy", 3.0, THERE | {"work": 3 * 2 * 9.81 * 1.6}),
    ("energy", 1.5, HALF_WAY | {"work": 3 * 2 * 9.81 * 0.8}),
    ("energy", 0.1 * 3.0, HALF_WAY | {"left": 1.44, "work": 3 * 2 * 9.81 * 0.25}),
    ("sub_goals", 0.5, THERE | {"closest": [0.0, 0.8, 9.0]}),
    ("sub_goals", 0.5, {"goal": 1.6, "left": 1.6, "closest": [0.0, 0.8, 9.0]}),
    # Penalties scale with the share of the way: half at half way, none without progress.
    ("ground", 0.15, HALF_WAY | {"ground": 300.0}),
    ("fall", 0.0, {"reason": int(Reason.TIPPED)}),
    ("time", 0.0, HALF_WAY | {"left": 1.7}),
]


@pytest.mark.parametrize(("name", "value", "stats"), CASES)
def test_terms_match_hand_computed_values(stool: Creature, name: str, value: float, stats: dict):
    body = altered(stool, frame={"hip_height": 0.5, "mass": 2.0, "body_length": 1.0})
    arrays = {key: jnp.asarray(number) for key, number in stats.items()}
    filled = dataclasses.replace(empty(body, HORIZON), **arrays)
    assert float(fitness_terms(body, HORIZON, filled)[name]) == pytest.approx(value, abs=1e-5)


def test_every_term_has_a_nonzero_case():
    assert {name for name, value, _ in CASES if value} == set(TERMS)


def tallied(task: Hop, moments: list[Sensed], torques: list[list[float]]) -> HopStats:
    stats = task.init()
    for sensed, torque in zip(moments, torques, strict=True):
        params = task.params(task.settings)
        stats = task.update(stats, sensed, jnp.array(torque), params, jnp.float32(1.0))
    return jax.device_get(stats)


def test_work_and_sub_goals_are_recorded_only_with_a_weight(stool: Creature):
    """Braking gives no work back. For each sub-goal the nearest moment counts."""
    way = [(0.0, 0.0), (0.5, 0.1), (0.9, 0.0)]
    speed = jnp.array([1.0, -2.0, 0.0, 0.0])
    moments = [moment(stool, *place, joint_vel=speed) for place in way]
    torques = [[3.0, 1.0, 9.0, 0.0], [-1.0, -1.0, 0.0, 0.0], [0.0] * 4]
    ends, settings = stool.settings.termination, HopConfig(sub_goals=(0.25, 0.5))
    off = Hop(stool, STEP, HORIZON, ends, settings)
    assert set(TERMS) - set(off.terms) == {"energy", "sub_goals"}
    stats = tallied(off, moments, torques)
    assert (stats.work, stats.closest) == (None, None)
    weights = HopWeights(energy=0.1, sub_goals=0.2)
    on = Hop(stool, STEP, HORIZON, ends, dataclasses.replace(settings, weights=weights))
    assert set(on.terms) == set(TERMS)
    stats = tallied(on, moments, torques)
    assert stats.work == pytest.approx((3.0 + 2.0) * STEP)
    assert stats.closest == pytest.approx([0.25, 0.1], abs=1e-6)
    evaluation = on.evaluate(stats, on.settings)
    assert set(evaluation) == set(on.terms)
    counted = on.weights(on.settings, jnp.int32(10))
    # Style weights, halfway up their ramp.
    assert float(counted["energy"]) == pytest.approx(-0.05)
    assert float(counted["sub_goals"]) == pytest.approx(-0.1)


@pytest.mark.parametrize("points", ["[]", "[0.5, 1.5]", "[0.0]"])
def test_sub_goals_must_lie_on_the_way(points: str, tmp_path: Path, luxo: Creature):
    file = tmp_path / "mine.toml"
    file.write_text(f"[fitness]\nsub_goals = {points}\n")
    with pytest.raises(UserError, match=r"mine.toml: fitness\.sub_goals"):
        resolve_config(luxo.settings.train, "luxo", file)


@pytest.mark.parametrize("generation", [0, 10, 1000])
def test_getting_nearer_in_any_style_beats_standing_still(generation: int):
    """The worst style has every style term at its maximum, 1, scaled by the share of the way."""
    weights = {n: float(w) for n, w in signed_weights(HopConfig(), jnp.int32(generation)).items()}
    manner = sum(weights[name] for name in STYLE if name in weights)
    scores = [
        weights["distance"] * (1 - near) + manner * near for near in np.linspace(0.0, 1.0, 11)
    ]
    assert all(np.diff(scores) > 0)


def test_style_weights_ramp_up_and_goal_weights_do_not():
    settings = HopConfig(style_ramp=20, weights=HopWeights(distance=3.0, ground=0.5))
    by_generation = [signed_weights(settings, jnp.int32(g)) for g in (0, 10, 20, 99)]
    assert [float(weights["distance"]) for weights in by_generation] == [-3.0] * 4
    ground = [float(weights["ground"]) for weights in by_generation]
    assert ground == pytest.approx([0.0, -0.25, -0.5, -0.5])
    assert float(signed_weights(HopConfig(style_ramp=0), jnp.int32(0))["fall"]) < 0


# Episodes


REACH = """
import jax.numpy as jnp
from mjxgait.controllers.base import RealController


class Reach(RealController):
    reads = ("goal_distance",)

    def bounds(self, settings):
        return {"reach": (0.0 * self.creature.joints.stand, 0.0 * self.creature.joints.stand + 1.0)}

    def act(self, plan, memory, senses):
        return self.creature.joints.stand + 0.4 * plan["reach"] * senses["goal_distance"], memory
"""
ALIKE = {"joint_noise": 0.0, "velocity_noise": 0.0, "friction": (1.0, 1.0), "gains": 0.0, "push": 0}


@pytest.fixture(scope="module")
def experiment(stool: Creature, tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """Trials that differ only in their goals, for a controller that follows the goal distance.
    Energy and sub-goals have a weight.
    """
    file = tmp_path_factory.mktemp("reach") / "reach.py"
    file.write_text(REACH)
    table = {
        "use": {"task": "hop", "controller": load("controller", f"{file}:Reach")},
        "evolution": {"population": 6},
        "rollout": {"seconds": 0.4, "starts": 3, "promote": 1.0, "lanes": 4, **ALIKE},
        "fitness": {"weights": {"energy": 0.1, "sub_goals": 0.2}, "sub_goals": [0.1, 0.5]},
    }
    return build_experiment(stool, build_config(table, "test"))


@pytest.fixture(scope="module")
def evaluated(experiment: Experiment) -> tuple[EvolutionState, HopStats]:
    """The first population, and the statistics [6, 3] of its trials."""
    state = experiment.init()
    return state, jax.device_get(jax.jit(experiment.simulate)(state.genomes).stats)


def test_every_episode_is_evaluated_with_its_own_goal(experiment: Experiment, evaluated):
    _, stats = evaluated
    goals = np.asarray(experiment.starts.goal)
    assert len(set(goals.tolist())) == 3
    np.testing.assert_array_equal(stats.goal, np.tile(goals, (6, 1)))
    way = stats.goal - stats.left
    # In 0.4 s no individual gets far, but some move.
    assert (np.abs(way) < 0.4).all()
    assert np.abs(way).max() > 1e-3


def test_weighted_energy_and_sub_goals_are_recorded(evaluated):
    _, stats = evaluated
    assert (stats.work > 0).all()
    # In 0.4 s all stay nearer to the first point and reach none.
    assert stats.closest.shape == (6, 3, 2)
    assert (stats.closest[..., 0] < stats.closest[..., 1]).all()
    assert (stats.closest[..., 0] > 0).all()


def test_evolution_and_reference_simulator_use_the_same_goals(
    stool: Creature, experiment: Experiment, evaluated
):
    state, stats = evaluated
    starts = nominal_starts(stool, 3)
    starts.goal[:] = experiment.starts.goal
    # The first two touch the floor one step earlier in one precision than in the other.
    way = (stats.goal - stats.left)[2]
    # The statistics end before the last step.
    path = simulate(stool, experiment.champion(state, {}, 2), starts, 0.4).path[:, -2]
    np.testing.assert_allclose(way, path, atol=1e-4)
    assert np.ptp(path) > 1e-2


# The lamp


def test_a_body_without_legs_takes_its_highest_joint_as_hip(luxo: Creature):
    """The neck, above the ankle and both arms."""
    assert luxo.frame.hip_height == pytest.approx(luxo.frame.stand_height + 0.025 + 0.175 + 0.16)


def test_the_lamp_stands(luxo: Creature):
    standing = record(luxo, pose_champion(luxo, np.stack([luxo.joints.stand] * 2), {}), 3.0)
    assert standing.trunk_up.min() > 0.999
    assert not standing.touch.any()
    last = standing.window(1.0)
    assert np.abs(last.trunk_pos[:, :2] - last.trunk_pos[0, :2]).max() < 1e-3
    assert last.foot_force.sum(1) == pytest.approx(luxo.frame.mass * 9.81, rel=0.02)


def test_a_lamp_on_its_head_touches_the_floor(luxo: Creature):
    """Folded forward until the shade meets the floor."""
    folded = np.array([luxo.joints.pose_high[0], luxo.joints.pose_high[1], luxo.joints.pose_low[2]])
    assert record(luxo, pose_champion(luxo, np.stack([folded] * 2), {}), 2.0).touch.any()


def test_the_lamp_hops_by_default(luxo: Creature):
    usual = resolve_config(luxo.settings.train, luxo.name)
    assert (usual.use.task, type(usual.fitness)) == ("hop", HopConfig)
    walking = resolve_config(luxo.settings.train, luxo.name, use={"task": "walk"})
    assert (walking.use.task, type(walking.fitness)) == ("walk", WalkConfig)


def test_a_settings_layer_applies_only_to_its_own_task():
    train = {"use": {"task": "hop"}, "fitness": {"style_ramp": 7}}
    assert resolve_config(train, "mine").fitness.style_ramp == 7
    assert resolve_config(train, "mine", use={"task": "walk"}).fitness == WalkConfig()


def test_a_user_file_can_have_settings_for_the_lamp_only(luxo: Creature, tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text("[creature.luxo.fitness.weights]\ntime = 0.3\n")
    assert resolve_config(luxo.settings.train, "luxo", file).fitness.weights.time == 0.3


@pytest.mark.thorough("test_limbo.py trains the lamp, and other tests here evaluate its hops")
def test_a_short_run_ends_with_a_champion_and_a_certificate(tmp_path: Path, capsys):
    folder, short = tmp_path / "run", tmp_path / "short.toml"
    short.write_text(SHORT + "[hop]\nstay = 1.0\n")
    small = "--population 6 --generations 1 --rollout.seconds 0.4 --rollout.lanes 4"
    rest = "--examination.candidates 0 --no-plots --controller.nodes 16 --controller.depth 4"
    rest += " --controller.initial-depth 2 4"
    said_by(
        capsys, "train", "--env", "luxo", *small.split(), *rest.split(), "--out", folder, code=0
    )
    champion = json.loads((folder / "champion.json").read_text())
    assert champion["task"] == "hop"
    assert list(champion["terms"]) == list(terms_under(HopWeights()))
    assert set(champion["origin"]["nominal"]) == {"left", "off", "arrival", "seconds"}
    said_by(capsys, "certify", folder, "--config", short, code=0)
    certificate = json.loads((folder / "certificate.json").read_text())
    assert [c["number"] for c in certificate["criteria"]] == [1, 2, 4, 6, 8, 9]
    assert certificate["report"]["goal"] == NOMINAL_GOAL
    assert "program, hop" in said_by(capsys, "inspect", folder, code=0)
