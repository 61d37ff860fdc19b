"""Episodes on lanes: an evaluation depends only on the genome and the start."""

import copy
import dataclasses
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from helpers import STOOL, small_config, weight_vector

from mjxgait.config.layers import data_folder, resolve_config
from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.controller import Genome
from mjxgait.creature import Creature, load_creature
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.variation import Box, uniform
from mjxgait.simulation.episode import reason_of
from mjxgait.simulation.evaluator import LocalEvaluator
from mjxgait.simulation.rollout import Episodes
from mjxgait.tasks.base import in_order
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import NEVER, Starts, draw_starts
from mjxgait.tasks.terms import score
from mjxgait.tasks.walk.fitness import (
    BEYOND,
    REWARDS,
    TERMS,
    fitness_terms,
    terms_under,
)
from mjxgait.tasks.walk.gaits import stride_limit
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.generation import evolution_of
from mjxgait.types import BodyState, Evaluation, Sensed

ENDS = (Reason.TIPPED, Reason.TOO_LOW, Reason.TOO_HIGH, Reason.TOUCHED)


def genomes(experiment: Experiment, count: int, seed: int = 0) -> Genome:
    return uniform(
        key_of(seed),
        Box(*experiment.simulator.controller.bounds(experiment.config.controller)),
        count,
    )


def with_lanes(experiment: Experiment, lanes: int, devices: int) -> Experiment:
    """Other lanes and devices, and a load per plan, as if commands differed in cost."""
    mesh = jax.sharding.Mesh(np.array(jax.devices()[:devices]), ("lanes",))
    other, controller = dataclasses.replace(experiment), copy.copy(experiment.simulator.controller)
    vars(controller)["load"] = lambda plan: plan.tuning[0]
    simulator = dataclasses.replace(
        experiment.simulator, lanes=lanes, mesh=mesh, controller=controller
    )
    vars(other)["simulator"] = simulator  # where the property keeps it
    return other


@cache
def program(experiment: Experiment) -> Callable[[Genome, Starts], Episodes]:
    """One compiled program per experiment."""
    return jax.jit(experiment.simulate)


def simulate(experiment: Experiment, population: Genome, starts: Starts | None = None) -> Episodes:
    return jax.device_get(program(experiment)(population, starts or experiment.starts))


def evaluation(
    experiment: Experiment, population: Genome, starts: Starts | None = None
) -> Evaluation:
    verdict = jax.jit(LocalEvaluator(experiment.simulator).evaluation_of)
    return verdict(experiment.row.settings, simulate(experiment, population, starts))


@pytest.fixture(scope="module")
def experiment(stool: Creature) -> Experiment:
    return build_experiment(stool, small_config(rollout={"lanes": 3}))


@pytest.fixture(scope="module")
def episodes(experiment: Experiment) -> Episodes:
    return simulate(experiment, genomes(experiment, 7))


def test_every_genome_runs_on_every_start(experiment: Experiment, episodes: Episodes):
    assert episodes.stats.steps.shape == (7, 2)
    assert (episodes.stats.steps > 0).all()
    finished = episodes.stats.reason == Reason.FINISHED
    assert (episodes.stats.steps[finished] == experiment.simulator.steps).all()
    assert episodes.computed_steps >= episodes.stats.steps.sum()


@pytest.mark.parametrize(
    ("lanes", "devices"), [(5, 2), pytest.param(16, 1, marks=pytest.mark.thorough("other lanes"))]
)
def test_results_do_not_depend_on_lanes_devices_or_load(
    experiment: Experiment, episodes: Episodes, lanes: int, devices: int
):
    """Batch sizes may round differently in float32, by less than 0.1 mm in half a second."""
    other = simulate(with_lanes(experiment, lanes, devices), genomes(experiment, 7))
    assert np.allclose(other.stats.forward, episodes.stats.forward, atol=1e-4)
    assert (other.stats.steps == episodes.stats.steps).all()


def test_the_order_of_results_is_the_order_of_the_genomes(
    experiment: Experiment, episodes: Episodes
):
    backwards = simulate(experiment, jax.tree.map(lambda leaf: leaf[::-1], genomes(experiment, 7)))
    assert np.allclose(backwards.stats.forward[::-1], episodes.stats.forward, atol=1e-4)


def test_a_nonfinite_individual_does_not_affect_its_neighbours(
    experiment: Experiment, episodes: Episodes
):
    population = genomes(experiment, 7)
    poisoned = dataclasses.replace(population, key_poses=population.key_poses.at[3].set(jnp.nan))
    found = simulate(experiment, poisoned)
    assert (found.stats.reason[3] == Reason.NONFINITE).all()
    others = [0, 1, 2, 4, 5, 6]
    assert np.allclose(found.stats.forward[others], episodes.stats.forward[others], atol=1e-4)


def test_a_nonfinite_genome_gets_the_lowest_score(experiment: Experiment):
    population = genomes(experiment, 7)
    poisoned = dataclasses.replace(population, key_poses=population.key_poses.at[2].set(jnp.nan))
    terms = evaluation(experiment, poisoned).terms
    fitness = evolution_of(experiment.simulator, experiment.config).rank(terms, jnp.int32(0))
    assert np.isneginf(fitness[2])
    assert np.isfinite(np.delete(fitness, 2)).all()


def test_physics_that_breaks_at_once_has_no_finite_terms(experiment: Experiment):
    """No step has been counted, so there is nothing to score."""
    starts = experiment.starts
    broken = dataclasses.replace(starts, qvel=starts.qvel.at[1, 0].set(jnp.nan))
    terms = evaluation(experiment, genomes(experiment, 7), broken).terms
    assert np.isnan(terms[:, 1]).all()
    assert np.isfinite(terms[:, 0]).all()


def start_at(experiment: Experiment, height: float = 0.0, roll: float = 0.0) -> Starts:
    """The starts with the trunk moved up and rolled over."""
    starts = experiment.starts
    qpos = (
        starts.qpos.at[:, 2]
        .add(height)
        .at[:, 3:5]
        .set(jnp.array([np.cos(roll / 2), np.sin(roll / 2)]))
    )
    return dataclasses.replace(starts, qpos=qpos)


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        ({"height": 1.0, "roll": 2.5}, Reason.TIPPED),
        ({"height": 0.3}, Reason.TOO_HIGH),
        ({"height": -0.2}, Reason.TOO_LOW),
        ({"height": -0.1}, Reason.TOUCHED),
    ],
)
def test_an_episode_ends_at_once_with_its_reason(
    experiment: Experiment, start: dict, reason: Reason
):
    found = simulate(experiment, genomes(experiment, 7), start_at(experiment, **start)).stats
    assert (found.reason == reason).all()
    assert (found.steps == 0).all()
    assert (found.forward == 0).all()


def standing(experiment: Experiment, low: float = 0.1, **others: jax.Array) -> Sensed:
    """Observations in the standing pose, with watched parts at height `low`; `others` override."""
    creature = experiment.creature
    joints, zero = jnp.zeros(len(creature.joints.names)), jnp.zeros(3)
    usual = {
        "joint_pos": joints,
        "joint_vel": joints,
        "bias": jnp.zeros(creature.model.nv),
        "trunk_pos": jnp.array([0.0, 0.0, creature.frame.stand_height]),
        "trunk_rot": jnp.eye(3),
        "trunk_vel": zero,
        "trunk_angvel": zero,
        "geom_pos": jnp.zeros((len(creature.feet.watched), 3)),
        "geom_low": jnp.full(len(creature.feet.watched), low),
    }
    return Sensed(**usual | others)


def reason_to_end(
    experiment: Experiment, height: float = 1.0, up: float = 1.0, low: float = 0.1
) -> Reason:
    """Why an episode ends. height: of the trunk, in standing heights. up: cosine of its tilt.
    low: height of the watched parts, m.
    """
    tilt = np.arccos(up)
    turned = [[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]]
    sensed = standing(
        experiment,
        low,
        trunk_pos=jnp.array([0.0, 0.0, height * experiment.creature.frame.stand_height]),
        trunk_rot=jnp.array(turned),
    )
    return Reason(int(reason_of(experiment.simulator.task, sensed, ())))


WRONG = {
    Reason.TIPPED: {"up": -1.0},
    Reason.TOO_LOW: {"height": 0.4},
    Reason.TOO_HIGH: {"height": 1.9},
    Reason.TOUCHED: {"low": -0.01},
}


@pytest.mark.parametrize(
    ("settings", "ends"),
    [
        ({}, set(ENDS)),
        ({"terminate": False}, set()),
        ({"termination": {"touch": False}}, set(ENDS) - {Reason.TOUCHED}),
        ({"termination": {"min_up": -1.0}}, set(ENDS) - {Reason.TIPPED}),
        ({"termination": {"height": [0.0, 1.5]}}, set(ENDS) - {Reason.TOO_LOW}),
        ({"termination": {"height": [0.5, 2.0]}}, set(ENDS) - {Reason.TOO_HIGH}),
    ],
)
def test_the_settings_decide_what_ends_an_episode(
    stool: Creature, settings: dict, ends: set[Reason]
):
    """Other settings come from the creature."""
    requested = build_experiment(stool, small_config(rollout=settings))
    for reason, moment in WRONG.items():
        assert reason_to_end(requested, **moment) == (reason if reason in ends else Reason.FINISHED)


def test_without_termination_only_nonfinite_values_end_an_episode(stool: Creature):
    endless = build_experiment(stool, small_config(rollout={"terminate": False}))
    assert reason_to_end(endless, height=float("nan")) == Reason.NONFINITE


def test_the_dead_are_not_judged_on(experiment: Experiment):
    """Statistics do not change after an episode has ended, even if the body stands well again."""
    simulator, starts = experiment.simulator, experiment.starts
    creature, fast = experiment.creature, jnp.full(3, 2.0)
    stats = dataclasses.replace(simulator.task.init(), steps=jnp.int32(7), forward=jnp.float32(0.3))
    start = jax.tree.map(lambda leaf: leaf[0], starts)
    lane = SimpleNamespace(
        goal=simulator.task.goal(start),
        params=simulator.task.params(experiment.row.settings.fitness),
    )
    sensed = standing(experiment, trunk_vel=fast)
    torque = jnp.ones(len(creature.joints.names))

    @jax.jit
    def after(reason: jax.Array, steps: jax.Array) -> object:
        lane.stats = dataclasses.replace(stats, reason=reason, steps=steps)
        return simulator._updated_stats(lane, sensed, torque)

    alive = after(jnp.int32(Reason.FINISHED), jnp.int32(7))
    assert alive.steps == 8
    assert alive.reason == Reason.FINISHED
    for reason, steps in ((Reason.TIPPED, 7), (Reason.FINISHED, simulator.steps)):
        known = dataclasses.replace(stats, reason=jnp.int32(reason), steps=jnp.int32(steps))
        found = after(known.reason, known.steps)
        jax.tree.map(np.testing.assert_array_equal, found, known)


@pytest.mark.thorough("test_the_dead_are_not_judged_on asks the same of one step")
def test_statistics_stop_at_the_end_of_an_episode(experiment: Experiment, stool: Creature):
    """A longer episode adds nothing to an individual that has fallen."""
    long = build_experiment(stool, small_config(rollout={"lanes": 3, "seconds": 0.8}))
    population = genomes(long, 7)
    leaning = start_at(experiment, height=0.1, roll=0.9)
    starts = dataclasses.replace(leaning, qvel=leaning.qvel.at[:, 3].set(6.0))
    first, second = (
        simulate(experiment, population, starts).stats,
        simulate(long, population, starts).stats,
    )
    died = np.asarray(first.reason != Reason.FINISHED)
    assert died.any()
    for before, after in zip(jax.tree.leaves(first), jax.tree.leaves(second), strict=True):
        assert np.allclose(np.asarray(before)[died], np.asarray(after)[died], rtol=1e-3, atol=1e-4)


def test_the_first_start_is_nominal_and_the_others_are_not(stool: Creature):
    config = small_config(rollout={"starts": 5, "seconds": 2.0})
    starts = draw_starts(key_of(3), stool, config.rollout)
    assert np.allclose(starts.qpos[0], stool.stand_qpos)
    assert not starts.qvel[0].any()
    assert float(starts.friction[0]) == 1.0
    assert int(starts.push_step[0]) == NEVER
    noise = np.asarray(starts.qpos[1:, stool.joints.qpos_adr] - stool.joints.stand)
    widest = config.rollout.joint_noise
    assert 0.4 * widest < np.abs(noise).max() <= widest
    assert np.allclose(
        np.linalg.norm(starts.push[1:, :2], axis=1),
        config.rollout.push * np.sqrt(9.81 * stool.frame.hip_height),
    )
    assert ((starts.push_step[1:] >= 100) & (starts.push_step[1:] < 300)).all()
    assert len(set(np.asarray(starts.friction[1:]).tolist())) == 4


def standing_terms(experiment: Experiment) -> dict[str, float]:
    """The terms of an individual with all key poses equal to the standing pose."""
    still = genomes(experiment, 7)
    poses = jnp.broadcast_to(
        jnp.asarray(experiment.creature.joints.stand, jnp.float32), still.key_poses.shape
    )
    stats = jax.tree.map(
        lambda leaf: leaf[0, 0],
        simulate(experiment, dataclasses.replace(still, key_poses=poses)).stats,
    )
    terms = fitness_terms(
        experiment.creature, experiment.config.fitness, 0.005, experiment.simulator.steps, stats
    )
    return {name: float(value) for name, value in terms.items()}


def test_terms_of_an_individual_that_stands_still(experiment: Experiment):
    terms = standing_terms(experiment)
    # Upright to the end, without progress.
    assert terms["alive"] == pytest.approx(0.25, abs=1e-3)
    for name in set(TERMS) - {"alive"}:
        assert terms[name] == pytest.approx(0.0, abs=0.02), name


def test_style_counts_in_proportion_to_progress(experiment: Experiment):
    """A dragging foot costs nothing without progress, and its full weight at the target speed."""
    creature, config, horizon = (
        experiment.creature,
        experiment.config.fitness,
        experiment.simulator.steps,
    )
    enough = config.speed * horizon * 0.005 * creature.frame.body_length
    for share in (0.0, 0.5, 1.0):
        stats = dataclasses.replace(
            experiment.simulator.task.init(),
            steps=jnp.int32(horizon),
            forward=jnp.float32(share * enough),
        )
        terms = fitness_terms(creature, config, 0.005, horizon, stats)
        assert float(terms["clearance"]) == pytest.approx(share, abs=1e-5)


def test_distance_beyond_the_target_speed_counts_little(experiment: Experiment):
    creature, config, horizon = (
        experiment.creature,
        experiment.config.fitness,
        experiment.simulator.steps,
    )
    lengths = config.speed * horizon * 0.005
    stats = dataclasses.replace(
        experiment.simulator.task.init(),
        forward=jnp.float32(3 * lengths * creature.frame.body_length),
    )
    term = float(fitness_terms(creature, config, 0.005, horizon, stats)["distance"])
    assert term == pytest.approx(lengths * (1 + 2 * BEYOND), rel=1e-5)
    metres = experiment.simulator.task.outcome(stats)["forward"]
    assert float(metres) == pytest.approx(3 * lengths * creature.frame.body_length, rel=1e-4)


def test_a_fall_scores_below_all_that_stay_up(experiment: Experiment, stool: Creature):
    """With the weights of configs/wilson.toml, at any distance; by default a fall costs nothing."""
    thesis = resolve_config({}, stool.name, Path("wilson"))
    steps, evaluate = experiment.simulator.steps, experiment.simulator.task

    def fitness(config: Config, forward: float, reason: Reason, after: int) -> float:
        stats = dataclasses.replace(
            evaluate.init(),
            steps=jnp.int32(after),
            reason=jnp.int32(reason),
            forward=jnp.float32(forward),
        )
        named = fitness_terms(stool, config.fitness, 0.005, steps, stats)
        terms = in_order(named, terms_under(config.fitness.weights))
        return float(score(terms[None], weight_vector(config.fitness, jnp.int32(0)), 0.0))

    fallen = {reason: fitness(thesis, 50.0, reason, steps - 1) for reason in ENDS}
    backwards = fitness(thesis, -3.0, Reason.FINISHED, steps)
    assert all(value < backwards - 100 for value in fallen.values())
    free = dataclasses.replace(Config(), fitness=dataclasses.replace(Config().fitness, speed=0.0))
    assert fitness(free, 3.0, Reason.TIPPED, steps) == fitness(free, 3.0, Reason.FINISHED, steps)


def test_score_mixes_the_worst_start_and_the_mean():
    terms = jnp.array([[[1.0], [3.0]]])
    assert float(score(terms, jnp.ones(1), 0.0)[0]) == 2.0
    assert float(score(terms, jnp.ones(1), 1.0)[0]) == 1.0
    assert float(score(terms, jnp.ones(1), 0.5)[0]) == 1.5


def test_penalties_are_negative_and_style_ramps_in():
    config = small_config(fitness={"style_ramp": 10}).fitness
    vectors = {
        generation: np.asarray(weight_vector(config, jnp.int32(generation))).tolist()
        for generation in (0, 5, 10)
    }
    terms = terms_under(config.weights)
    at = {
        generation: dict(zip(terms, vector, strict=True)) for generation, vector in vectors.items()
    }
    assert all(at[10][name] <= 0 for name in terms if name not in REWARDS)
    assert at[0]["slip"] == 0.0
    assert at[5]["slip"] == pytest.approx(0.5 * at[10]["slip"])
    assert at[0]["distance"] == at[10]["distance"] > 0


def test_the_stride_limit_of_a_dog():
    assert stride_limit(20.0) == pytest.approx(3.53, abs=0.01)


LARGER = pytest.mark.thorough("the same on the stool")


@pytest.mark.parametrize(
    "folder",
    [
        STOOL,
        *(pytest.param(data_folder("envs") / name, marks=LARGER) for name in ("crab", "duck")),
    ],
    ids=lambda folder: folder.name,
)
def test_mjx_agrees_with_c_mujoco(folder: Path):
    """Equal controlled motion, 60 steps through touchdown, in float32 MJX and float64 C MuJoCo."""
    creature, config = load_creature(folder), Config()
    experiment = build_experiment(
        creature,
        dataclasses.replace(config, rollout=dataclasses.replace(config.rollout, physics="mjx")),
    )
    model = creature.evolution_model
    data = mujoco.MjData(model)
    data.qpos[:] = creature.stand_qpos
    plant = experiment.simulator.plant
    state = jax.tree.map(lambda leaf: leaf[None], _at_rest(creature))
    torque = np.zeros((1, model.nv), np.float32)

    def advance(state, torque):
        sensed, step_data = plant.forward(state)
        return plant.advance(state, step_data, torque), sensed

    step = jax.jit(advance)
    rng = np.random.default_rng(0)
    for k in range(60):
        if k % 10 == 0:
            torque[0, creature.joints.dof_adr] = (
                rng.uniform(-0.1, 0.1, len(creature.joints.dof_adr)) * creature.gains.torque_limit
            )
        data.qfrc_applied[:] = torque[0]
        state, _ = step(state, torque)
        mujoco.mj_step(model, data)
    assert np.allclose(state.qpos[0], data.qpos, atol=5e-3)


def _at_rest(creature: Creature):
    still = jnp.zeros(creature.model.nv)
    return BodyState(
        jnp.asarray(creature.stand_qpos, jnp.float32), still, still, still, jnp.ones(())
    )
