"""Promotion: all individuals run the first trial, and only the better ones the others."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.key_poses.controller import Genome
from mjxgait.controllers.key_poses.operators import pose_variation
from mjxgait.creature import Creature
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.evolution import Evolution
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.evolution.variation import Box
from mjxgait.training.experiment import Batch, Experiment, build_experiment, row_of
from mjxgait.training.generation import evolution_of, first_trials
from mjxgait.types import Evaluation, RequestedTrials

Trials = tuple[Experiment, EvolutionState, GenerationMetrics, Callable[[np.ndarray], Evaluation]]
"""A run, its first generation, and evaluations of its first genomes in requested trials [N, R]."""


@pytest.fixture(scope="module")
def half(stool: Creature) -> Trials:
    rollout = {"starts": 3, "lanes": 4, "promote": 0.5}
    experiment = build_experiment(stool, small_config(rollout=rollout))
    batch = Batch((experiment,))
    stages, (numbers, rows) = batch.stages(), batch.known
    states = batch.place(batch.init())
    state, metrics = jax.device_get(row_of(batch.bound(stages)(states)))
    proposals, starts = stages.propose(numbers, rows, states)
    known = first_trials(states, proposals).known
    assert stages.evaluate is not None

    def verdict(wanted: np.ndarray) -> Evaluation:
        requested = RequestedTrials(wanted[None], known)
        evaluation = stages.evaluate(numbers, rows.settings, starts, proposals.offspring, requested)
        return jax.tree.map(lambda leaf: leaf[0], jax.device_get(evaluation))

    return experiment, state, metrics, verdict


@pytest.fixture(scope="module")
def everybody(half: Trials) -> Evaluation:
    """The evaluation of all in all trials, in the order of `genomes`."""
    return half[-1](np.ones((6, 3), bool))


def genomes(half: Trials) -> list[bytes]:
    """The genomes of the first population."""
    return [poses.tobytes() for poses in np.asarray(half[0].init().genomes.key_poses)]


def steps(half: Trials, evaluation: Evaluation) -> np.ndarray:
    """The steps of each trial, [N, R]."""
    seconds = evaluation.outcome[..., half[0].simulator.task.outcomes.index("seconds")]
    return np.round(seconds / float(half[0].creature.model.opt.timestep)).astype(int)


def by_genome(state: EvolutionState) -> dict[bytes, tuple[np.ndarray, float]]:
    """Terms and fitness of each genome."""
    return {
        poses.tobytes(): (terms, float(fitness))
        for poses, terms, fitness in zip(
            state.genomes.key_poses, state.terms, state.fitness, strict=True
        )
    }


def test_promotion_gives_the_same_result_as_all_trials(half: Trials, everybody: Evaluation):
    experiment, state, _, _ = half
    rank = evolution_of(experiment.simulator, experiment.config).rank
    worth = np.asarray(rank(everybody.terms, jnp.int32(0)))
    known = dict(zip(genomes(half), zip(everybody.terms, worth, strict=True), strict=True))
    found = by_genome(state)
    assert found.keys() == known.keys()
    task = experiment.simulator.task
    weights = [task.weights(experiment.config.fitness, 0)[name] for name in task.terms]
    first = {genome: float(terms[0] @ weights) for genome, (terms, _) in known.items()}
    best = sorted(first, key=first.__getitem__)[-3:]
    for genome, (terms, fitness) in found.items():
        np.testing.assert_allclose(terms[0], known[genome][0][0], atol=1e-4)
        if genome in best:
            np.testing.assert_allclose(terms, known[genome][0], atol=1e-4)
            assert fitness == pytest.approx(known[genome][1], abs=1e-3)
        else:
            assert np.isnan(terms[1:]).all()
            assert fitness == -np.inf


def test_only_trials_that_were_run_are_counted(half: Trials, everybody: Evaluation):
    """Six individuals run the first trial, three of them two more."""
    _, some, counted, _ = half
    promoted = {genome for genome, (_, fitness) in by_genome(some).items() if np.isfinite(fitness)}
    ran = [
        lived if genome in promoted else lived[:1]
        for genome, lived in zip(genomes(half), steps(half, everybody), strict=True)
    ]
    assert len(promoted) == 3
    assert int(counted.episodes) == 12
    assert int(counted.sim_steps) == sum(map(np.sum, ran))
    assert int(counted.computed_steps) >= int(counted.sim_steps)


def test_quartiles_cover_only_evaluated_individuals(half: Trials):
    """Like the mean; half of the population has no fitness. Between two values either is right."""
    _, state, told, _ = half
    evaluation = state.fitness[np.isfinite(state.fitness)]
    assert 0 < len(evaluation) < len(state.fitness)
    either = [np.percentile(evaluation, [25, 50, 75], method=side) for side in ("lower", "higher")]
    found = (told.lower_quartile, told.median, told.upper_quartile)
    assert all(one in pair for one, *pair in zip(found, *either, strict=True))
    assert told.mean == pytest.approx(evaluation.mean(), rel=1e-5)


def test_a_trial_that_is_not_requested_is_not_simulated(half: Trials, everybody: Evaluation):
    """It has no result; the other results are as if all trials were requested."""
    wanted = np.arange(18).reshape(6, 3) % 4 == 1
    some = half[-1](wanted)
    assert np.isnan(some.outcome[~wanted]).all()
    assert (steps(half, everybody)[wanted] > 0).all()
    assert some.sim_steps == steps(half, everybody)[wanted].sum()
    np.testing.assert_allclose(some.outcome[wanted], everybody.outcome[wanted], atol=1e-4)
    np.testing.assert_allclose(some.terms[wanted], everybody.terms[wanted], atol=1e-4)
    assert some.computed_steps < everybody.computed_steps


def judged_first(values: list[float]) -> Evaluation:
    """An evaluation of the first trial only."""
    terms = jnp.full((len(values), 2, 1), jnp.nan).at[:, 0, 0].set(jnp.array(values))
    nothing = jnp.zeros((len(values), 2), bool)
    return Evaluation(terms, terms, nothing, jnp.int32(0), jnp.int32(0))


def promoted_of(values: list[float], share: float, seeded: int = 0, **settings: Any) -> list[int]:
    """Indices of the promoted among six individuals with these values in the first trial."""
    config = EvolutionConfig(population=6, **settings)
    box = Box(*(Genome(jnp.full((1, 1), end), jnp.full(1, end)) for end in (-1.0, 1.0)))

    def rank(terms: jax.Array, generation: jax.Array) -> jax.Array:
        worth = terms[..., 0].min(-1)
        return jnp.where(jnp.isfinite(worth), worth, -jnp.inf)

    evolution = Evolution(config, pose_variation(box, config), rank)

    @jax.jit
    def found() -> jax.Array:
        state = evolution.init(key_of(0), 2, 1, 1)
        proposal = evolution.propose(state)
        state = dataclasses.replace(state, seeded=jnp.int32(seeded))
        return evolution.promising(state, proposal, judged_first(values), share)

    return np.flatnonzero(found()).tolist()


@pytest.mark.parametrize(
    ("values", "share", "promoted"),
    [
        ([0.0, 3.0, 1.0, 5.0, 4.0, 2.0], 0.5, [1, 3, 4]),
        ([0.0, 3.0, 1.0, 5.0, 4.0, 2.0], 0.3, [3, 4]),
        ([np.nan, 3.0, np.nan, np.nan, np.nan, np.nan], 0.5, [1]),
    ],
    ids=["half", "a third", "who is not finite never"],
)
def test_the_best_of_the_first_start_are_promoted(
    values: list[float], share: float, promoted: list[int]
):
    assert promoted_of(values, share) == promoted


@pytest.mark.parametrize(("seeded", "promoted"), [(6, [0, 1, 5]), (0, [4, 5])])
def test_the_elite_runs_all_trials(seeded: int, promoted: list[int]):
    """Its first result does not matter. Before there is an elite, all must be promoted."""
    share = 0.17 if seeded else 0.34
    values = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert promoted_of(values, share, seeded, survival="children", elite=0.34) == promoted
