"""Small bodies are simulated by a smaller program, and move as in that of all others."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.api import load_creature
from mjxgait.controllers.sims_brain.reference_body import grow
from mjxgait.plugins.registry import build_config
from mjxgait.tasks.base import in_order
from mjxgait.tasks.terms import score
from mjxgait.training.experiment import Batch, Experiment, arrays_of, build_experiment
from mjxgait.training.generation import all_trials
from mjxgait.training.stages import CompiledGeneration
from mjxgait.types import Evaluation, RequestedTrials

COUNT, TRIALS, SMALL = 40, 2, 2
TABLE: dict[str, Any] = {
    "use": {"controller": "brain", "task": "swim"},
    "controller": {
        "nodes": 3,
        "parts": 4,
        "links": 4,
        "small": SMALL,
        "local": 1,
        "central": 1,
    },
    "evolution": {"population": COUNT},
    "rollout": {"seconds": 0.8, "starts": TRIALS, "promote": 1.0, "lanes": 8, "joint_noise": 0.1},
    "fitness": {"settle": 0.1},
}


def experiment_of(**changed: Any) -> Experiment:
    table = TABLE | {"controller": TABLE["controller"] | changed}
    return build_experiment(load_creature("blocks"), build_config(table, "test"))


@dataclasses.dataclass(frozen=True)
class First:
    """The first population of a run, and its programs. given: what both simulations read."""

    stages: CompiledGeneration
    given: tuple[Any, ...]
    request: RequestedTrials
    best: float

    def small(self, request: RequestedTrials) -> RequestedTrials:
        assert self.stages.small is not None
        found: RequestedTrials = jax.device_get(self.stages.small(*self.given, request))
        return found

    def evaluate(self, request: RequestedTrials) -> Evaluation:
        assert self.stages.evaluate is not None
        found: Evaluation = jax.device_get(self.stages.evaluate(*self.given, request))
        return found

    @property
    def genomes(self) -> Any:
        return jax.tree.map(lambda leaf: leaf[0], self.given[-1])


@pytest.fixture(scope="module")
def first() -> First:
    batch = Batch((experiment_of(),))
    stages, (numbers, rows), states = batch.stages(), batch.known, batch.place(batch.init())
    _, metrics = batch.bound(stages)(states)
    proposals, starts = stages.propose(numbers, rows, states)
    given = (numbers, rows.settings, starts, proposals.offspring)
    return First(stages, given, all_trials(states, proposals), float(metrics.best[0]))


@pytest.fixture(scope="module")
def links(first: First) -> np.ndarray:
    """Links of each individual, as the reference body counts them."""
    arrays = arrays_of(first.genomes)
    bodies = [grow({n: a[i] for n, a in arrays.items()}, 4, 4) for i in range(COUNT)]
    return np.array([sum(max(len(part.hinges), 1) for part in parts) for parts in bodies])


@pytest.fixture(scope="module")
def others(first: First) -> RequestedTrials:
    """The request that remains after the small bodies."""
    return first.small(first.request)


def test_each_trial_is_run_by_the_program_of_the_bodys_size(
    first: First, others: RequestedTrials, links: np.ndarray
):
    fits = np.repeat((links <= SMALL)[:, None], TRIALS, 1)
    assert 0.2 < fits.mean() < 0.8
    np.testing.assert_array_equal(others.wanted[0], ~fits)
    np.testing.assert_array_equal(np.isfinite(others.known.terms[0]).all(2), fits)


def test_results_are_those_of_one_program(first: First, others: RequestedTrials):
    both, alone = first.evaluate(others), first.evaluate(first.request)
    np.testing.assert_array_equal(both.failed, alone.failed)
    np.testing.assert_allclose(both.terms, alone.terms, atol=2e-4)
    np.testing.assert_allclose(both.outcome, alone.outcome, atol=2e-4)
    assert np.abs(both.outcome[0, :, :, 0]).max() > 0.01, "they move"
    assert both.sim_steps[0] == alone.sim_steps[0]


def test_a_generation_runs_both_programs(first: First, others: RequestedTrials):
    """Its best is the best of all."""
    terms = first.evaluate(others).terms[0]
    experiment = experiment_of()
    task, config = experiment.simulator.task, experiment.config
    speed = terms[:, :, task.terms.index("speed")].mean(1)
    assert np.isfinite(first.best)
    assert 0 < first.best <= speed.max() + 1e-6
    weights = in_order(task.weights(config.fitness, jnp.int32(0)), task.terms)
    fitness = score(jnp.asarray(terms), weights, config.rollout.worst, config.rollout.caution)
    assert first.best == pytest.approx(float(fitness.max()), rel=1e-5)


def test_known_results_stay(first: First):
    """Of the trials that are requested each is run, and no other."""
    wanted = (np.arange(COUNT) % 3 == 0)[None, :, None] & np.array([True, False])
    before = first.evaluate(first.small(first.request))
    known = dataclasses.replace(before, terms=before.terms + 7.0)
    found = first.evaluate(first.small(RequestedTrials(wanted, known)))
    np.testing.assert_array_equal(
        found.terms, np.where(wanted[..., None], before.terms, known.terms)
    )


def test_one_program_simulates_all_where_none_has_less_room():
    assert all(experiment_of(small=small).spec.small is None for small in (0, 4, 6))


def test_a_body_with_a_large_opponent_is_not_small(first: First, links: np.ndarray):
    small = experiment_of().spec.small
    assert small is not None
    few, many = (
        jax.tree.map(lambda leaf, at=at: leaf[at], first.genomes)
        for at in (int(links.argmin()), int(links.argmax()))
    )
    assert small.fits(few)
    assert not small.fits(many)
    assert small.fits(dataclasses.replace(few, opponent=few))
    assert not small.fits(dataclasses.replace(few, opponent=many))
    assert not small.fits(dataclasses.replace(many, opponent=few))
