"""PPO: its policy is the network controller, episode by episode; its parts do as they should."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config
from peers.gait_reward import GaitReward
from peers.policy_gradient import AXIS, Agent, Settings, World, forward
from ppo import FITNESS, settings_of, world_of

from mjxgait.controllers.network.config import READS
from mjxgait.controllers.network.controller import Network
from mjxgait.creature import Creature
from mjxgait.environments.functional import make_environment
from mjxgait.environments.problem import make_problem
from mjxgait.evolution.chance import key_of
from mjxgait.simulation.evaluator import LocalEvaluator
from mjxgait.tasks.base import in_order
from mjxgait.tasks.terms import score
from mjxgait.training.experiment import build_experiment

TOLERANCE = 1e-3
"""Of float32 after 80 steps, some of them on the edge of a contact."""


@pytest.mark.slow
@pytest.mark.thorough("it compiles a simulator and an environment of its own")
def test_an_episode_in_the_environment_is_the_controllers_in_the_simulator(stool: Creature):
    """On an undisturbed trial and one with a push, for two networks."""
    shape = {"hidden": (5,), "every": 2, "period": 0.3}
    config = settings_of(small_config(rollout={"lanes": 2}), 0, shape)
    experiment = build_experiment(stool, config)
    genomes = jax.tree.map(lambda leaf: leaf[:2], experiment.init().genomes)
    simulated = jax.jit(experiment.simulate)(genomes, experiment.starts)
    judged = jax.jit(LocalEvaluator(experiment.simulator).evaluation_of)(
        experiment.row.settings, simulated
    )
    task, last = experiment.simulator.task, config.evolution.generations
    weights = in_order(task.weights(experiment.row.settings.fitness, last), task.terms)
    wanted = score(judged.terms[:, :, None], weights, 0.5)

    env = make_environment(make_problem(stool, config, READS))
    network = Network.with_settings(stool, env.dt, config.controller, ())
    world = world_of(env, network, 0.3)

    @jax.jit
    def played(genome):
        def step(states, _):
            outputs = world.policy(genome, world.observe(states))
            after = world.step(states, outputs)
            return after, after.reward

        states = env.begin_lanes(experiment.starts)
        states, rewards = jax.lax.scan(step, states, None, length=env.horizon // 2)
        return states.metrics["fitness"], rewards.sum(0)

    found = []
    for row in range(2):
        fitness, reward = played(jax.tree.map(lambda leaf, row=row: leaf[row], genomes))
        assert np.allclose(fitness, reward / FITNESS, atol=TOLERANCE)
        found.append(fitness)
    assert np.allclose(found, wanted, atol=TOLERANCE)
    assert np.ptp(found) > 0.05


class Hill:
    """A world of one step per episode, with the highest reward where action is half the input."""

    inputs, joints = 1, 1

    @staticmethod
    def world() -> World:
        from types import SimpleNamespace

        class State(SimpleNamespace):
            pass

        jax.tree_util.register_pytree_node(
            State,
            lambda s: ((s.x, s.reward, s.metrics), None),
            lambda _, v: State(x=v[0], reward=v[1], metrics=v[2]),
        )

        def step(states, actions):
            reward = -jnp.square(actions[:, 0] - 0.5 * states.x)
            return State(x=states.x, reward=reward, metrics={"fitness": reward})

        def one(states):
            return jnp.ones_like(states.x)

        return State, World(
            step=step,
            observe=lambda states: states.x[:, None],
            outcome=lambda states: (states.reward, one(states), one(states)),
            restart=lambda over, fresh, states: fresh,
            policy=forward,
        )


def test_ppo_climbs_a_hill():
    state, world = Hill.world()
    settings = Settings(envs=64, unroll=4, minibatches=2, learning_rate=3e-3, value_hidden=(8,))
    agent = Agent(world, settings)
    learner = agent.init(key_of(0), 1, (8,), 1)
    mesh = jax.sharding.Mesh(np.array(jax.devices()[:1]), (AXIS,))
    spec = jax.sharding.PartitionSpec()
    iterate = jax.jit(
        jax.shard_map(agent.iterate, mesh=mesh, in_specs=spec, out_specs=spec, check_vma=False)
    )
    found = []
    for i in range(60):
        key = jax.random.fold_in(key_of(1), i)
        x = jax.random.uniform(key, (64,), minval=-2.0, maxval=2.0)
        fresh = state(x=x, reward=jnp.zeros(64), metrics={"fitness": jnp.zeros(64)})
        learner, _, seen = iterate(learner, fresh, fresh, key)
        found.append(float(seen["fitness"]))
    assert found[0] < -0.4
    x = jnp.linspace(-1.5, 1.5, 7)[:, None]
    assert np.allclose(forward(learner.actor, x), 0.5 * x, atol=0.15)
    assert float(jnp.exp(learner.deviation[0])) < 0.45


def test_a_trot_has_its_diagonal_feet_together(stool: Creature):
    reward = GaitReward(stool, 0.5, 0.02)
    heights = np.array([reward._rise(jnp.float32(time)) for time in (0.0, 0.125, 0.375)])
    front_left, front_right, hind_left, hind_right = heights.T
    assert np.allclose(front_left, hind_right, atol=1e-6)
    assert np.allclose(front_right, hind_left, atol=1e-6)
    assert front_left[1] == pytest.approx(0.0, abs=1e-6)
    assert front_right[1] == pytest.approx(0.14 * stool.frame.hip_height)
    assert front_left[2] == pytest.approx(front_right[1])
