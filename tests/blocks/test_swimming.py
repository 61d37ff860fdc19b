"""Bodies and brains that evolve together, through the same run as everybody's.

Compiling them takes two minutes: tried where MJXGAIT_TEST_SWIMMERS is set.
"""

import dataclasses
import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.control.brains.controller import Brains
from mjxgait.creature import Creature
from mjxgait.parts.registry import add_own
from mjxgait.parts.settings import build_config
from mjxgait.runs.experiment import Experiment, build_experiment
from mjxgait.tasks.swim import FASTEST_HINGE, Swim, Tally
from mjxgait.types import Sensed

pytestmark = pytest.mark.skipif(
    not os.environ.get("MJXGAIT_TEST_SWIMMERS"), reason="MJXGAIT_TEST_SWIMMERS is not set"
)
TABLE = {
    "use": {"controller": "brain", "task": "swim"},
    "controller": {"nodes": 3, "parts": 4, "links": 4, "local": 2, "central": 1},
    "evolution": {"population": 24},
    "rollout": {"seconds": 0.4, "starts": 2, "lanes": 16, "joint_noise": 0.1},
    "fitness": {"settle": 0.1},
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
    for _ in range(5):
        state, metrics = step(state)
        best.append(float(metrics.best))
    return state, best


def test_swimmers_get_faster(evolved):
    _, best = evolved
    assert np.isfinite(best).all()
    assert best == sorted(best)
    assert best[-1] > 1.5 * best[0] > 0


@pytest.fixture(scope="module")
def again(experiment: Experiment, evolved) -> Tally:
    """The best five, and four of them without any connection: leaves [9, 2, ...]."""
    best = jax.tree.map(lambda leaf: leaf[:5], evolved[0].genomes)
    alone = dataclasses.replace(
        best, graph=dataclasses.replace(best.graph, used=jnp.zeros_like(best.graph.used))
    )
    both = jax.tree.map(lambda a, b: jnp.concatenate([a, b[:4]]), best, alone)
    return jax.tree.map(np.asarray, experiment.simulate(both).tally)


def test_who_is_judged_again_swims_the_same(evolved, again: Tally):
    way = np.linalg.norm(again.place - again.settled, axis=-1)[:5]
    np.testing.assert_allclose(way, np.asarray(evolved[0].outcome)[:5, :, 0], rtol=1e-3)


def test_a_block_alone_does_not_swim(again: Tally):
    """Nothing moves it: its way is nothing."""
    np.testing.assert_allclose(again.place[5:], 0, atol=1e-6)
    assert (again.steps[5:] == 80).all()


def test_what_is_faster_than_anything_alive_ends(experiment: Experiment):
    task, nothing = experiment.simulator.task, jnp.zeros(3)
    calm = Sensed(
        joint_pos=jnp.zeros(3),
        joint_vel=jnp.zeros(3),
        bias=jnp.zeros(9),
        trunk_pos=nothing,
        trunk_rot=jnp.eye(3),
        trunk_vel=nothing,
        trunk_angvel=nothing,
        geom_pos=jnp.zeros((4, 3)),
        geom_low=jnp.zeros(4),
    )
    assert int(task.ended(calm, ())) == 0
    wild = dataclasses.replace(calm, joint_vel=calm.joint_vel.at[2].set(FASTEST_HINGE + 1))
    assert int(task.ended(wild, ())) == 1
