"""Everybody is tried in the first start, and only the better ones in the others."""

import dataclasses
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
from mjxgait.evolution.state import EvolutionState, GenerationMetrics, Proposal
from mjxgait.evolution.variation import Box
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.types import Judged

STARTS = {"starts": 3, "lanes": 4}


def after_the_first_generation(
    creature: Creature, promote: float
) -> tuple[Experiment, EvolutionState, GenerationMetrics]:
    config = small_config(rollout=STARTS | {"promote": promote})
    experiment = build_experiment(creature, config)
    state, metrics = experiment.compile()(experiment.place(experiment.init()))
    return experiment, *jax.device_get((state, metrics))


@pytest.fixture(scope="module")
def everybody(stool: Creature) -> tuple[Experiment, EvolutionState, GenerationMetrics]:
    return after_the_first_generation(stool, 1.0)


@pytest.fixture(scope="module")
def half(stool: Creature) -> tuple[Experiment, EvolutionState, GenerationMetrics]:
    return after_the_first_generation(stool, 0.5)


def by_genome(state: EvolutionState) -> dict[bytes, tuple[np.ndarray, float]]:
    """Terms and fitness of everybody."""
    return {
        poses.tobytes(): (terms, float(fitness))
        for poses, terms, fitness in zip(
            state.genomes.key_poses, state.terms, state.fitness, strict=True
        )
    }


def test_who_does_best_in_the_first_start_is_judged_as_if_all_were(everybody: Any, half: Any):
    experiment, state, _ = everybody
    known, found = by_genome(state), by_genome(half[1])
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


def test_only_what_was_run_is_counted(everybody: Any, half: Any):
    """Six in the first start, three of them in two more."""
    experiment, whole, _ = everybody
    _, some, counted = half
    promoted = {genome for genome, (_, fitness) in by_genome(some).items() if np.isfinite(fitness)}
    tally = jax.device_get(jax.jit(experiment.simulate)(whole.genomes).tally)
    ran = [
        lived if poses.tobytes() in promoted else lived[:1]
        for poses, lived in zip(whole.genomes.key_poses, tally.steps, strict=True)
    ]
    assert len(promoted) == 3
    assert int(counted.episodes) == 12
    assert int(counted.sim_steps) == sum(map(np.sum, ran))
    assert int(counted.computed_steps) >= int(counted.sim_steps)


def test_quartiles_are_of_those_who_were_judged(half: Any):
    """As the mean is; half of the population has no fitness. Between two of them it is either."""
    _, state, told = half
    judged = state.fitness[np.isfinite(state.fitness)]
    assert 0 < len(judged) < len(state.fitness)
    either = [np.percentile(judged, [25, 50, 75], method=side) for side in ("lower", "higher")]
    found = (told.lower_quartile, told.median, told.upper_quartile)
    assert all(one in pair for one, *pair in zip(found, *either, strict=True))
    assert told.mean == pytest.approx(judged.mean(), rel=1e-5)


def test_a_start_that_is_not_wanted_is_not_simulated(stool: Creature):
    """Its tally is untouched, and those of the others are what they are when all are wanted."""
    experiment = build_experiment(stool, small_config(rollout=STARTS))
    population = jax.tree.map(lambda leaf: leaf[None], experiment.init().genomes)
    rows = jax.tree.map(lambda leaf: leaf[None], (experiment.starts, experiment.row.settings))
    wanted = np.arange(18).reshape(1, 6, 3) % 4 == 1
    simulate = jax.jit(experiment.simulator.simulate)
    everything, some = jax.device_get(
        [simulate(population, *rows, jnp.asarray(mask)) for mask in (np.ones_like(wanted), wanted)]
    )
    assert (some.tally.steps[~wanted] == 0).all()
    assert (some.tally.steps[wanted] == everything.tally.steps[wanted]).all()
    np.testing.assert_allclose(
        some.tally.forward[wanted], everything.tally.forward[wanted], atol=1e-4
    )
    assert some.computed_steps < everything.computed_steps


def judged_first(values: list[float]) -> Judged:
    """A verdict on the first trial alone."""
    terms = jnp.full((len(values), 2, 1), jnp.nan).at[:, 0, 0].set(jnp.array(values))
    nothing = jnp.zeros((len(values), 2), bool)
    return Judged(terms, terms, nothing, jnp.int32(0), jnp.int32(0))


def toy(**settings: Any) -> tuple[Evolution, EvolutionState, Proposal]:
    config = EvolutionConfig(population=6, **settings)
    box = Box(*(Genome(jnp.full((1, 1), end), jnp.full(1, end)) for end in (-1.0, 1.0)))

    def rank(terms: jax.Array, generation: jax.Array) -> jax.Array:
        worth = terms[..., 0].min(-1)
        return jnp.where(jnp.isfinite(worth), worth, -jnp.inf)

    evolution = Evolution(config, pose_variation(box, config), rank)
    state = evolution.init(key_of(0), 2, 1, 1)
    return evolution, state, evolution.propose(state)


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
    evolution, state, proposal = toy()
    found = evolution.promising(state, proposal, judged_first(values), share)
    assert np.flatnonzero(found).tolist() == promoted


@pytest.mark.parametrize(("seeded", "promoted"), [(6, [0, 1, 5]), (0, [4, 5])])
def test_whoever_is_judged_once_more_is_tried_in_all_starts(seeded: int, promoted: list[int]):
    """The elite is, whatever it did in the first start; before there is one nobody is."""
    evolution, state, proposal = toy(survival="children", elite=0.34)
    state = dataclasses.replace(state, seeded=jnp.int32(seeded))
    share = 0.17 if seeded else 0.34
    found = evolution.promising(
        state, proposal, judged_first([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), share
    )
    assert np.flatnonzero(found).tolist() == promoted
