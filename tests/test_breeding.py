"""Children born one after another, as in the thesis: elder ones become parents, and none is like
another.
"""

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
from mjxgait.evolution.breeding import Nursery
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.variation import Box, first_occurrence

THESIS = EvolutionConfig(
    population=12,
    growth=4.0,
    selection="uniform",
    crossover=1.0,
    crossing="permute",
    mutation_rate=0.0,
    pool="growing",
    unique_children=True,
)


def marked(config: EvolutionConfig, poses: int) -> Genome:
    """A population in which every pose has a value of its own, from which one reads whose it is."""
    count = config.population * poses
    values = jnp.arange(count, dtype=jnp.float32).reshape(config.population, poses, 1)
    return Genome(jnp.tile(values, (1, 1, 2)), jnp.zeros((config.population, 1)))


@jax.jit
def bear(
    settings: EvolutionConfig, key: jax.Array, adults: Genome, reach: jax.Array
) -> tuple[Genome, jax.Array]:
    """Settings as inputs, as in a run: what differs in numbers only is compiled once."""
    low = jnp.zeros(adults.key_poses.shape[1:])
    box = Box(Genome(low, jnp.zeros(1)), Genome(low + reach, jnp.zeros(1)))
    return Nursery(settings, pose_variation(box, settings)).children(key, adults)


def born(poses: int = 3, seed: int = 0, **settings) -> tuple[Genome, Genome, jax.Array]:
    """The adults, their children, and which of these are crossings."""
    config = dataclasses.replace(THESIS, **settings)
    adults = marked(config, poses)
    reach = float(config.population * poses)
    settings = traced(Config(evolution=config)).evolution
    children, crossed = bear(settings, key_of(seed), adults, jnp.float32(reach))
    return adults, children, crossed


def ancestors(children: Genome, poses: int = 3) -> list[int]:
    """From how many adults each child has its poses."""
    whose = np.asarray(children.key_poses[..., 0]).astype(int) // poses
    return [len(set(row)) for row in whose]


def together(adults: Genome, children: Genome) -> Genome:
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), adults, children)


def test_children_of_a_growing_pool_are_parents_too():
    """Two adults have poses of two adults' at most; a third one's come through an elder child."""
    _, children, crossed = born()
    assert crossed.all()
    assert ancestors(children)[0] <= 2
    assert max(ancestors(children)) == 3


def test_otherwise_parents_are_adults():
    _, children, _ = born(pool="parents")
    assert max(ancestors(children)) <= 2


@pytest.mark.parametrize("pool", ["parents", "growing"])
def test_no_child_is_like_an_adult_or_a_sibling(pool: str):
    """Two adults of two poses have ten children that are not themselves; eight are asked for."""
    adults, children, _ = born(2, population=2, growth=5.0, pool=pool)
    assert first_occurrence(together(adults, children)).all()


def test_without_that_there_are_copies():
    adults, children, _ = born(2, population=2, growth=5.0, unique_children=False)
    assert not first_occurrence(together(adults, children)).all()


def test_where_no_child_would_be_new_it_is_a_mutant():
    """Two adults of one pose can only have themselves again."""
    adults, children, crossed = born(1, population=2, growth=3.0, pool="parents")
    assert not crossed.any()
    assert first_occurrence(together(adults, children)).all()


def test_children_of_one_parent_are_its_mutants():
    adults, children, crossed = born(crossover=0.0, mutation_rate=0.5, mutation="single")
    assert not crossed.any()
    first = np.asarray(children.key_poses[0] != adults.key_poses)
    assert first.sum(axis=(1, 2)).min() == 1
