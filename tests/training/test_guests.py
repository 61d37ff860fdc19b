"""Rows of one program that have the best of each other judged among their own children."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.evolution.state import EvolutionState, Proposal
from mjxgait.training import generation
from mjxgait.training.experiment import build_batch
from mjxgait.training.generation import SENT, with_guests

ROWS, POPULATION, CHILDREN = 3, 6, 5


def states(age: int) -> EvolutionState:
    """Genomes that tell who is who: 100 per row, 1 per rank."""
    who = 100.0 * jnp.arange(ROWS)[:, None] + jnp.arange(POPULATION)
    blank = {field.name: jnp.zeros(ROWS) for field in dataclasses.fields(EvolutionState)}
    told = {
        "genomes": {"poses": who[..., None]},
        "origin": jnp.full((ROWS, POPULATION), 2),
        "generation": jnp.full(ROWS, age),
    }
    return EvolutionState(**(blank | told))


def children(sources: list[list[int]], age: int) -> Proposal:
    nobody = Proposal(
        key=jnp.zeros(ROWS),
        offspring={"poses": jnp.full((ROWS, CHILDREN, 1), -1.0)},
        origin=jnp.ones((ROWS, CHILDREN), jnp.int32),
        born=jnp.full((ROWS, CHILDREN), age + 1),
    )
    return with_guests(jnp.int32(sources), states(age), nobody)


def test_one_of_the_best_of_each_source_takes_the_place_of_a_last_child():
    found = children([[1, 2], [0, 2], [1, 0]], age=0)
    assert found.offspring["poses"][..., 0].tolist() == [
        [-1, -1, -1, 100, 200],
        [-1, -1, -1, 0, 200],
        [-1, -1, -1, 100, 0],
    ]
    assert (found.origin[:, -2:] == 2).all()
    assert (found.origin[:, :-2] == 1).all()
    assert (found.born == 1).all()


def test_the_best_come_in_turn():
    who = [
        float(children([[1], [0], [0]], age).offspring["poses"][0, -1, 0])
        for age in range(SENT + 1)
    ]
    assert who == [*(100.0 + rank for rank in range(SENT)), 100.0]


def test_a_rows_own_number_stands_for_nobody():
    found = children([[1], [1], [0]], age=2).offspring["poses"][..., -1, 0]
    assert found.tolist() == [102, -1, 2]


def test_nobody_comes_who_has_not_been_judged():
    assert (children([[1], [0], [0]], age=-1).offspring["poses"] == -1).all()


def test_guests_are_seated_among_what_a_program_proposes(
    stool: Creature, small_configs: list[Config], monkeypatch: pytest.MonkeyPatch
):
    """Traced, which tells it without a minute of compiling; rows on their own have no such place."""
    seated = []

    def noted(sources: jax.Array, states: EvolutionState, proposals: Proposal) -> Proposal:
        seated.append((sources.shape, proposals.offspring.key_poses.shape[:2]))
        return proposals

    monkeypatch.setattr(generation, "with_guests", noted)
    for sources in ([], [[1], [0, 2], [1]]):
        batch = build_batch(stool, small_configs, sources=sources)
        proposed = partial(generation.propose, batch.experiments[0].spec, None)
        jax.eval_shape(proposed, batch.rows, batch.abstract())
    assert seated == [((3, 2), (3, 6))]


def test_rows_with_fewer_sources_are_filled_up_with_their_own_number(stool, small_configs):
    batch = build_batch(stool, small_configs, sources=[[1], [0, 2], [1]])
    np.testing.assert_array_equal(batch.rows.sources, [[1, 0], [0, 2], [1, 2]])
    assert build_batch(stool, small_configs).rows.sources is None


@pytest.fixture
def small_configs() -> list[Config]:
    return [dataclasses.replace(small_config(), seed=seed) for seed in range(3)]
