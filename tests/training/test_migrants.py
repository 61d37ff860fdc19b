"""Migrants between rows of one program: a row evaluates the best of others among its children."""

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
from mjxgait.training.generation import SENT, with_migrants

ROWS, POPULATION, CHILDREN = 3, 6, 5


def states(age: int) -> EvolutionState:
    """Genomes that identify their individual: 100 per row, 1 per rank."""
    who = 100.0 * jnp.arange(ROWS)[:, None] + jnp.arange(POPULATION)
    blank = {field.name: jnp.zeros(ROWS) for field in dataclasses.fields(EvolutionState)}
    told = {
        "genomes": {"poses": who[..., None]},
        "origin": jnp.full((ROWS, POPULATION), 2),
        "generation": jnp.full(ROWS, age),
    }
    return EvolutionState(**(blank | told))


def children(sources: list[list[int]], age: int) -> Proposal:
    bred = Proposal(
        key=jnp.zeros(ROWS),
        offspring={"poses": jnp.full((ROWS, CHILDREN, 1), -1.0)},
        origin=jnp.ones((ROWS, CHILDREN), jnp.int32),
        born=jnp.full((ROWS, CHILDREN), age + 1),
    )
    return with_migrants(jnp.int32(sources), states(age), bred)


def test_a_migrant_from_each_source_replaces_a_last_child():
    found = children([[1, 2], [0, 2], [1, 0]], age=0)
    assert found.offspring["poses"][..., 0].tolist() == [
        [-1, -1, -1, 100, 200],
        [-1, -1, -1, 0, 200],
        [-1, -1, -1, 100, 0],
    ]
    assert (found.origin[:, -2:] == 2).all()
    assert (found.origin[:, :-2] == 1).all()
    assert (found.born == 1).all()


def test_the_best_migrate_in_turn():
    who = [
        float(children([[1], [0], [0]], age).offspring["poses"][0, -1, 0])
        for age in range(SENT + 1)
    ]
    assert who == [*(100.0 + rank for rank in range(SENT)), 100.0]


def test_a_rows_own_index_means_no_migrant():
    found = children([[1], [1], [0]], age=2).offspring["poses"][..., -1, 0]
    assert found.tolist() == [102, -1, 2]


def test_no_migration_before_the_first_evaluation():
    assert (children([[1], [0], [0]], age=-1).offspring["poses"] == -1).all()


def test_migrants_enter_the_proposals_of_rows_with_sources(
    stool: Creature, small_configs: list[Config], monkeypatch: pytest.MonkeyPatch
):
    """Traced only, which spares a minute of compilation. Rows without sources have no migrants."""
    seated = []

    def noted(sources: jax.Array, states: EvolutionState, proposals: Proposal) -> Proposal:
        seated.append((sources.shape, proposals.offspring.key_poses.shape[:2]))
        return proposals

    monkeypatch.setattr(generation, "with_migrants", noted)
    for sources in ([], [[1], [0, 2], [1]]):
        batch = build_batch(stool, small_configs, sources=sources)
        proposed = partial(generation.propose, batch.experiments[0].spec, None)
        jax.eval_shape(proposed, batch.rows, batch.abstract())
    assert seated == [((3, 2), (3, 6))]


def test_missing_sources_are_padded_with_the_rows_own_index(stool, small_configs):
    batch = build_batch(stool, small_configs, sources=[[1], [0, 2], [1]])
    np.testing.assert_array_equal(batch.rows.sources, [[1, 0], [0, 2], [1, 2]])
    assert build_batch(stool, small_configs).rows.sources is None


@pytest.fixture
def small_configs() -> list[Config]:
    return [dataclasses.replace(small_config(), seed=seed) for seed in range(3)]
