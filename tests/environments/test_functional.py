"""The functional environment: an episode earns what the evaluator says its actions are worth."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config

import mjxgait
from mjxgait.config.schema import Config
from mjxgait.controllers.observations import SENSES, sense
from mjxgait.creature import Creature
from mjxgait.environments.functional import Environment, State, make_environment, on_lanes
from mjxgait.environments.problem import make_problem
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.variation import Box, uniform
from mjxgait.simulation.evaluator import LocalEvaluator
from mjxgait.tasks.base import in_order
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import Starts
from mjxgait.tasks.terms import score
from mjxgait.training.experiment import Experiment, build_experiment

COUNT = 7
TOLERANCE = 2e-4
"""Of float32 under other batch sizes, after 80 steps."""


@pytest.fixture(scope="module")
def config() -> Config:
    """With `COUNT` individuals it has the program of `test_rollout`, so the cache has it."""
    return small_config(rollout={"lanes": 3})


@pytest.fixture(scope="module")
def experiment(stool: Creature, config: Config) -> Experiment:
    return build_experiment(stool, config)


@pytest.fixture(scope="module")
def environment(stool: Creature, config: Config) -> Environment:
    return make_environment(make_problem(stool, config))


def played(
    environment: Environment, experiment: Experiment, trial: Starts, genome: object
) -> State:
    """All states [T] of an episode in which a genome's controller acts, without their data."""
    controller, creature = experiment.simulator.controller, environment.problem.creature
    plan = controller.prepare(genome, experiment.row.settings.controller)

    def step(carry: tuple, k: jax.Array) -> tuple:
        state, memory = carry
        senses = sense(creature, state.data.sensed, k * environment.dt, controller.reads)
        target, memory = controller.act(plan, memory, senses)
        action = environment.action(target)
        after = environment.step(state, action)
        return (after, memory), after.replace(data=None, info={**after.info, "action": action})

    begin = (environment.begin(trial), controller.init())
    return jax.lax.scan(step, begin, jnp.arange(environment.horizon))[1]


@pytest.fixture(scope="module")
def played_and_evaluated(environment: Environment, experiment: Experiment) -> tuple:
    """Episodes [R * N, T] of some genomes, what the evaluator says of them [N, R], and the trials.

    In one trial there is a push. In the other, gains, friction and joints differ, and the body is
    thrown too high.
    """
    settings, starts = experiment.config.controller, experiment.starts
    genomes = uniform(key_of(0), Box(*experiment.simulator.controller.bounds(settings)), COUNT)
    starts = dataclasses.replace(
        starts,
        qvel=starts.qvel.at[1, 2].set(3.0),
        push=starts.push.at[0].set(2 * starts.push[1]),
        push_step=starts.push_step.at[0].set(30),
    )
    simulated = jax.jit(experiment.simulate)(genomes, starts)
    judged = jax.jit(LocalEvaluator(experiment.simulator).evaluation_of)(
        experiment.row.settings, simulated
    )
    episode = partial(played, environment, experiment)
    trial = jax.tree.map(lambda leaf: jnp.repeat(leaf, COUNT, axis=0), starts)
    twice = jax.tree.map(lambda leaf: jnp.concatenate([leaf] * 2), genomes)
    found = jax.jit(jax.vmap(episode))(trial, twice)
    return jax.device_get((found, judged, starts))


def test_the_return_is_the_fitness_of_the_evaluator(
    experiment: Experiment, played_and_evaluated: tuple
):
    states, judged, _ = played_and_evaluated
    task, last = experiment.simulator.task, experiment.config.evolution.generations
    weights = in_order(task.weights(experiment.row.settings.fitness, last), task.terms)
    fitness = score(judged.terms[:, :, None], weights, 0.5).T.reshape(-1)
    assert 0 < judged.failed.sum() < judged.failed.size
    assert np.ptp(fitness) > 0.1
    assert np.allclose(states.reward.sum(axis=1), fitness, atol=TOLERANCE)
    assert np.allclose(states.metrics["fitness"][:, -1], fitness, atol=TOLERANCE)
    for names, kind, values in (
        (task.terms, "term", judged.terms),
        (task.outcomes, "outcome", judged.outcome),
    ):
        for i, name in enumerate(names):
            ended = states.metrics[f"{kind}_{name}"][:, -1]
            assert np.allclose(ended, values[..., i].T.reshape(-1), atol=TOLERANCE), name


def test_an_episode_ends_with_the_tasks_own_end_or_its_time(played_and_evaluated: tuple):
    states, judged, _ = played_and_evaluated
    failed = judged.failed.T.reshape(-1)
    assert (states.done[:, -1] == 1).all()
    assert ((states.info["reason"][:, -1] != Reason.FINISHED) == failed).all()
    assert (states.info["time_out"][:, -1] == ~failed).all()
    for done, reward in zip(states.done, states.reward, strict=True):
        end = int(np.argmax(done))
        assert done[end:].all()
        assert not reward[end + 1 :].any()
    assert (states.done.sum(axis=1)[failed] > 1).all()


def test_gymnasium_in_c_mujoco_agrees(environment: Environment, played_and_evaluated: tuple):
    """The same actions on the same trials, through a push and to the end of what goes too high."""
    pytest.importorskip("gymnasium")
    from mjxgait.environments.gym import CreatureEnv, compiled

    states, _, starts = played_and_evaluated
    other = CreatureEnv(compiled(environment.problem))
    for trial, row in ((0, 2), (1, COUNT + 2)):
        other.begin(jax.tree.map(lambda leaf, trial=trial: leaf[trial], starts))
        steps = [other.step(action) for action in states.info["action"][row]]
        seen = np.array([observation for observation, *_ in steps])
        fitness = np.cumsum([reward for _, reward, *_ in steps])
        done = [terminated or truncated for _, _, terminated, truncated, _ in steps]
        assert np.array_equal(done, states.done[row])
        until = done.index(True) + 1
        assert np.allclose(seen[:until], states.obs[row, :until], atol=0.02)
        assert np.allclose(fitness, states.metrics["fitness"][row], atol=0.002)


def test_episodes_of_vmap_are_lanes():
    """The physics sees all episodes as lanes, whatever loop or axis is around them."""
    seen = []

    def watched(x: jax.Array, y: jax.Array) -> jax.Array:
        seen.append((x.shape, y.shape))
        return x * jnp.sum(y, axis=0)

    one = on_lanes(watched, -1)
    x, y = jnp.arange(6.0).reshape(3, 2), jnp.arange(4.0)

    def twice(x: jax.Array) -> jax.Array:
        return jax.lax.scan(lambda x, _: (one(x, y), None), x, length=2)[0]

    assert np.array_equal(jax.vmap(twice)(x[:, 0]), x[:, 0] * 36)
    assert seen[-1] == ((3,), (4, 3))
    assert np.array_equal(jax.vmap(jax.vmap(one, (0, None)), (0, None))(x, y), x * 6)
    assert one(x[1, 1], y) == 18


def test_every_number_of_an_observation_has_a_name(environment: Environment, stool: Creature):
    states = jax.eval_shape(environment.reset, key_of(0))
    assert states.obs.shape == (environment.observation_size,)
    assert len(set(environment.entries)) == environment.observation_size
    assert environment.entries[0] == f"joint_pos {stool.joints.names[0]}"
    assert environment.entries[-1] == f"contact {stool.feet.names[-1]}"
    everything = make_problem(stool, small_config(), tuple(SENSES)).entries
    foot = stool.feet.names[-1]
    assert {f"foot_place {foot} ahead", "trunk_rot z 2", "time"} <= set(everything)


def test_observations_are_in_the_order_of_their_names(environment: Environment):
    problem = environment.problem
    progress, blank = problem._blank()
    sensed = dataclasses.replace(blank, joint_vel=np.array([1.0, 2.0, 3.0, np.nan]))
    progress = jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), progress)
    seen = dict(zip(problem.entries, problem.observation(progress, sensed).tolist(), strict=True))
    names = problem.creature.joints.names
    assert [seen[f"joint_vel {name}"] for name in names] == [1, 2, 3, 0]


def test_actions_span_each_joints_range(environment: Environment):
    low, high = environment.problem.ranges
    assert np.allclose(environment.targets(-jnp.ones(4)), low)
    assert np.allclose(environment.targets(2 * jnp.ones(4)), high)
    middle = 0.3 * low + 0.7 * high
    assert np.allclose(environment.targets(environment.action(middle)), middle, atol=1e-6)


def test_a_body_that_grows_and_an_unknown_name_are_one_sentence(stool: Creature):
    with pytest.raises(UserError, match="blocks: its body grows from each genome"):
        mjxgait.environment("blocks")
    with pytest.raises(UserError, match='no observation "joint_poss"; did you mean "joint_pos"'):
        mjxgait.environment(stool, observe=["joint_poss"])
    with pytest.raises(UserError, match="only bodies that grow swim"):
        mjxgait.environment(stool, "swim")
