"""Rows of one program that have the best of each other judged among their own children."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config

from mjxgait.creature import Creature
from mjxgait.runs.experiment import build_batch
from mjxgait.runs.generation import SENT, propose, with_guests
from mjxgait.search.state import EvolutionState, Proposal
from mjxgait.settings.config import Config

ROWS, POPULATION, CHILDREN = 3, 6, 5


def states(generation: int) -> EvolutionState:
    """Genomes that tell who is who: 100 per row, 1 per rank."""
    who = 100.0 * jnp.arange(ROWS)[:, None] + jnp.arange(POPULATION)
    blank = {field.name: jnp.zeros(ROWS) for field in dataclasses.fields(EvolutionState)}
    told = {
        "genomes": {"poses": who[..., None]},
        "origin": jnp.full((ROWS, POPULATION), 2),
        "generation": jnp.full(ROWS, generation),
    }
    return EvolutionState(**(blank | told))


def children(sources: list[list[int]], generation: int) -> Proposal:
    nobody = Proposal(
        key=jnp.zeros(ROWS),
        offspring={"poses": jnp.full((ROWS, CHILDREN, 1), -1.0)},
        origin=jnp.ones((ROWS, CHILDREN), jnp.int32),
        born=jnp.full((ROWS, CHILDREN), generation + 1),
    )
    return with_guests(jnp.int32(sources), states(generation), nobody)


def test_one_of_the_best_of_each_source_takes_the_place_of_a_last_child():
    found = children([[1, 2], [0, 2], [1, 0]], generation=0)
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
        float(children([[1], [0], [0]], generation).offspring["poses"][0, -1, 0])
        for generation in range(SENT + 1)
    ]
    assert who == [*(100.0 + rank for rank in range(SENT)), 100.0]


def test_a_rows_own_number_stands_for_nobody():
    found = children([[1], [1], [0]], generation=2).offspring["poses"][..., -1, 0]
    assert found.tolist() == [102, -1, 2]


def test_nobody_comes_who_has_not_been_judged():
    assert (children([[1], [0], [0]], generation=-1).offspring["poses"] == -1).all()


def test_a_program_seats_the_guests_of_its_rows(stool: Creature, small_configs: list[Config]):
    """In the last place of the children that the algorithm itself proposes."""
    batch = build_batch(stool, small_configs, sources=[[1], [0, 2], [1]])
    blueprint = batch.experiments[0].blueprint
    states = dataclasses.replace(
        batch.init(), generation=jnp.zeros(3, jnp.int32), seeded=jnp.full(3, 6)
    )
    found, _ = jax.jit(partial(propose, blueprint, None))(batch.rows, states)
    alone, _ = jax.jit(partial(propose, blueprint, None))(
        dataclasses.replace(batch.rows, sources=None), states
    )
    poses, best = found.offspring.key_poses, states.genomes.key_poses[:, 0]
    np.testing.assert_array_equal(poses[1, -2:], best[jnp.array([0, 2])])
    np.testing.assert_array_equal(poses[0, -2], best[1])
    np.testing.assert_array_equal(poses[0, -1], alone.offspring.key_poses[0, -1])
    np.testing.assert_array_equal(poses[:, :-2], alone.offspring.key_poses[:, :-2])


def test_rows_with_fewer_sources_are_filled_up_with_their_own_number(stool, small_configs):
    batch = build_batch(stool, small_configs, sources=[[1], [0, 2], [1]])
    np.testing.assert_array_equal(batch.rows.sources, [[1, 0], [0, 2], [1, 2]])
    assert build_batch(stool, small_configs).rows.sources is None


@pytest.fixture
def small_configs() -> list[Config]:
    return [dataclasses.replace(small_config(), seed=seed) for seed in range(3)]
