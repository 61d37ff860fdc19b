"""Sequential breeding, as in the thesis: earlier children become parents, and all differ."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.schema import Config
from mjxgait.config.traced import traced
from mjxgait.controllers.key_poses.controller import Genome
from mjxgait.controllers.key_poses.operators import pose_variation
from mjxgait.evolution.breeding import SequentialBreeding
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.variation import Box, first_occurrence

THESIS = EvolutionConfig(
    population=4,
    growth=6.0,
    selection="uniform",
    crossover=1.0,
    crossing="permute",
    mutation_rate=0.0,
    pool="growing",
    unique_children=True,
)


def marked(config: EvolutionConfig, poses: int) -> Genome:
    """A population in which a unique value of each pose identifies its individual."""
    count = config.population * poses
    values = jnp.arange(count, dtype=jnp.float32).reshape(config.population, poses, 1)
    return Genome(jnp.tile(values, (1, 1, 2)), jnp.zeros((config.population, 1)))


@jax.jit
def bear(
    settings: EvolutionConfig, key: jax.Array, adults: Genome, reach: jax.Array
) -> tuple[Genome, jax.Array]:
    """Settings are inputs, as in a run: settings that differ only in numbers compile once."""
    low = jnp.zeros(adults.key_poses.shape[1:])
    box = Box(Genome(low, jnp.zeros(1)), Genome(low + reach, jnp.zeros(1)))
    return SequentialBreeding(settings, pose_variation(box, settings)).children(key, adults)


POSES = 3


def born(alike: bool = False, **settings) -> tuple[Genome, Genome, jax.Array]:
    """Adults, children and which children are crossings. alike: all adults are copies of one."""
    config = dataclasses.replace(THESIS, **settings)
    adults = marked(config, POSES)
    if alike:
        adults = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[:1], leaf.shape), adults)
    reach = float(config.population * POSES)
    settings = traced(Config(evolution=config)).evolution
    children, crossed = bear(settings, key_of(0), adults, jnp.float32(reach))
    return adults, children, crossed


def ancestors(children: Genome) -> list[int]:
    """The number of adults that each child's poses come from."""
    whose = np.asarray(children.key_poses[..., 0]).astype(int) // POSES
    return [len(set(row)) for row in whose]


def together(adults: Genome, children: Genome) -> Genome:
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), adults, children)


def test_children_of_a_growing_pool_are_parents_too():
    """Two adults give poses of two adults at most; a third's come through an earlier child."""
    _, children, crossed = born()
    assert crossed.all()
    assert ancestors(children)[0] <= 2
    assert max(ancestors(children)) == 3


def test_without_a_growing_pool_parents_are_adults():
    _, children, _ = born(pool="parents")
    assert max(ancestors(children)) <= 2


@pytest.mark.parametrize("pool", ["parents", "growing"])
def test_no_child_equals_an_adult_or_a_sibling(pool: str):
    """Aligned crossing of four adults with three poses has 36 new children; 20 are requested."""
    adults, children, crossed = born(pool=pool, crossing="align")
    assert crossed.sum() > 10
    assert first_occurrence(together(adults, children)).all()


def test_without_unique_children_there_are_copies():
    adults, children, _ = born(crossing="align", unique_children=False)
    assert not first_occurrence(together(adults, children)).all()


def test_a_child_is_mutated_where_no_crossing_is_new():
    """Aligned crossing of identical adults can only repeat them."""
    adults, children, crossed = born(alike=True, crossing="align", pool="parents")
    assert not crossed.any()
    one = jax.tree.map(lambda leaf: leaf[:1], adults)
    assert first_occurrence(together(one, children)).all()


def test_children_of_one_parent_are_its_mutants():
    adults, children, crossed = born(crossover=0.0, mutation_rate=0.5, mutation="single")
    assert not crossed.any()
    first = np.asarray(children.key_poses[0] != adults.key_poses)
    assert first.sum(axis=(1, 2)).min() == 1
