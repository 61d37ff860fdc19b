"""Bodies and brains that evolve together, through the same run as everybody's."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.control.brains.controller import Brains
from mjxgait.creature import Creature
from mjxgait.parts.registry import add_own
from mjxgait.parts.settings import build_config
from mjxgait.runs.experiment import Experiment, build_experiment
from mjxgait.tasks.swim import FASTEST_HINGE, Swim
from mjxgait.types import Sensed

TABLE = {
    "use": {"controller": "brain", "task": "swim"},
    "controller": {"parts": 6, "links": 6},
    "evolution": {"population": 24},
    "rollout": {"seconds": 1.0, "starts": 2, "lanes": 16, "joint_noise": 0.1},
    "fitness": {"settle": 0.2},
}


@pytest.fixture(scope="module")
def experiment(stool: Creature) -> Experiment:
    """Any creature lends its name and its time step; nothing else of it is simulated."""
    add_own("controller", "brain", Brains)
    add_own("task", "swim", Swim)
    return build_experiment(stool, build_config(TABLE, "test"))


@pytest.fixture(scope="module")
def evolved(experiment: Experiment):
    step, state = experiment.compile(), experiment.place(experiment.init())
    best = []
    for _ in range(6):
        state, metrics = step(state)
        best.append(float(metrics.best))
    return state, best


def test_swimmers_get_faster(evolved):
    _, best = evolved
    assert np.isfinite(best).all()
    assert best == sorted(best)
    assert best[-1] > 1.5 * best[0] > 0


def test_who_is_judged_again_swims_the_same(experiment: Experiment, evolved):
    state, _ = evolved
    genomes = jax.tree.map(lambda leaf: leaf[:5], state.genomes)
    tally = experiment.simulate(genomes).tally
    way = np.linalg.norm(tally.place - tally.settled, axis=-1)
    assert way.shape == (5, 2)
    np.testing.assert_allclose(way, np.asarray(state.outcome)[:5, :, 0], rtol=1e-3)


def test_a_block_alone_does_not_swim(experiment: Experiment, evolved):
    """Nothing moves it: its way is nothing."""
    graph = evolved[0].genomes.graph
    alone = dataclasses.replace(
        evolved[0].genomes, graph=dataclasses.replace(graph, used=jnp.zeros_like(graph.used))
    )
    tally = experiment.simulate(jax.tree.map(lambda leaf: leaf[:4], alone)).tally
    np.testing.assert_allclose(tally.place, 0, atol=1e-6)
    assert (np.asarray(tally.steps) == 200).all()


def test_what_is_faster_than_anything_alive_ends(experiment: Experiment):
    task, nothing = experiment.simulator.task, jnp.zeros(3)
    calm = Sensed(
        joint_pos=jnp.zeros(5),
        joint_vel=jnp.zeros(5),
        bias=jnp.zeros(11),
        trunk_pos=nothing,
        trunk_rot=jnp.eye(3),
        trunk_vel=nothing,
        trunk_angvel=nothing,
        geom_pos=jnp.zeros((6, 3)),
        geom_low=jnp.zeros(6),
    )
    assert int(task.ended(calm, ())) == 0
    wild = dataclasses.replace(calm, joint_vel=calm.joint_vel.at[2].set(FASTEST_HINGE + 1))
    assert int(task.ended(wild, ())) == 1
