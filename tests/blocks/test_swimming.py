"""Bodies and brains that evolve together, through the same run as everybody's."""

import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.certify.afloat import afloat
from mjxgait.certify.simulate import simulate
from mjxgait.certify.starts import nominal_starts
from mjxgait.champion import read_champion, write_champion
from mjxgait.champion.blocks.material import DRAG
from mjxgait.library import load_creature
from mjxgait.parts.settings import build_config
from mjxgait.runs.experiment import Experiment, build_experiment
from mjxgait.tasks.swim import FASTEST_HINGE, Tally
from mjxgait.types import Sensed

TABLE = {
    "use": {"controller": "brain", "task": "swim"},
    "controller": {"nodes": 3, "parts": 4, "links": 4, "local": 2, "central": 1},
    "evolution": {"population": 24},
    "rollout": {"seconds": 0.8, "starts": 2, "lanes": 16, "joint_noise": 0.1},
    "fitness": {"settle": 0.1, "weights": {"overlap": 0.0}},
}


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    """Little room, so that it compiles fast."""
    return build_experiment(load_creature("blocks"), build_config(TABLE, "test"))


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
    assert best[-1] > best[0] > 0


@pytest.fixture(scope="module")
def again(experiment: Experiment, evolved) -> Tally:
    """The best eight, and four of them without any connection: leaves [12, 2, ...]."""
    best = jax.tree.map(lambda leaf: leaf[:8], evolved[0].genomes)
    alone = dataclasses.replace(
        best, graph=dataclasses.replace(best.graph, used=jnp.zeros_like(best.graph.used))
    )
    both = jax.tree.map(lambda a, b: jnp.concatenate([a, b[:4]]), best, alone)
    return jax.tree.map(np.asarray, experiment.simulate(both).tally)


def test_who_is_judged_again_swims_the_same(evolved, again: Tally):
    way = np.linalg.norm(again.place - again.settled, axis=-1)[:8]
    np.testing.assert_allclose(way, np.asarray(evolved[0].outcome)[:8, :, 0], rtol=1e-3)


def test_a_block_alone_does_not_swim(again: Tally):
    """Nothing moves it: its way is nothing."""
    np.testing.assert_allclose(again.place[8:], 0, atol=1e-6)
    assert (again.steps[8:] == 80).all()


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
        middle=nothing,
    )
    assert int(task.ended(calm, ())) == 0
    wild = dataclasses.replace(calm, joint_vel=calm.joint_vel.at[2].set(FASTEST_HINGE + 1))
    assert int(task.ended(wild, ())) == 1


def test_the_examiner_sees_them_swim_as_far(experiment: Experiment, evolved, again: Tally):
    """Body, brain and water, all written twice: in the end everybody is in the same place."""
    state, _ = evolved
    mine, ways = (again.place - again.settled)[:8, 0], []
    for rank in range(8):
        champion = experiment.champion(state, {}, rank)
        body = champion.embodied(experiment.creature)
        film = simulate(body, champion, nominal_starts(body, 1), 0.8, record=1).trajectory
        middle = afloat(body, film.qpos[0], film.qvel[0], DRAG).middle
        # It counts from 0.1 s on; the tally has seen what was before the last step.
        ways.append(middle[-1] - middle[10])
    lengths = np.linalg.norm(ways, axis=1)
    assert lengths.max() > 0.02
    apart = np.linalg.norm(mine - np.array(ways), axis=1)
    assert np.median(apart / (lengths + 0.01)) < 0.02
    assert (apart < 0.1 * lengths + 0.002).mean() >= 0.75, "a threshold may be met a tick apart"


def test_a_champion_of_theirs_is_a_file(experiment: Experiment, evolved, tmp_path: Path):
    champion = experiment.champion(evolved[0], {})
    write_champion(champion, experiment.creature, tmp_path / "champion.json")
    again = read_champion(tmp_path / "champion.json", experiment.creature)
    assert again.fingerprint == champion.fingerprint
    assert again.embodied(experiment.creature).files == champion.embodied(experiment.creature).files
