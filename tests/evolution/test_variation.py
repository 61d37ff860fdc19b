"""Variation operators: offspring stay inside the box, and genes come from the stated source."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.schema import Config
from mjxgait.config.traced import traced
from mjxgait.controllers.key_poses.controller import Genome
from mjxgait.controllers.key_poses.operators import pose_variation
from mjxgait.evolution import variation
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.variation import Box, first_occurrence

K, J, E = 3, 5, 7
BOX = Box(
    Genome(-jnp.ones((K, J)) * jnp.arange(1, J + 1), jnp.zeros(E)),
    Genome(jnp.ones((K, J)) * jnp.arange(1, J + 1), jnp.ones(E).at[0].set(0.0)),
)


def keys(count: int) -> jax.Array:
    return jax.random.split(key_of(0), count)


def inside(genomes: Genome) -> bool:
    pairs = zip(
        jax.tree.leaves(BOX.low), jax.tree.leaves(genomes), jax.tree.leaves(BOX.high), strict=True
    )
    return all(bool(jnp.all((low <= leaf) & (leaf <= high))) for low, leaf, high in pairs)


def inputs(config: EvolutionConfig) -> EvolutionConfig:
    """Settings as program inputs, as in a run; all kinds of an operator share a program."""
    return traced(Config(evolution=config)).evolution


@partial(jax.jit, static_argnums=1)
def creating(settings: EvolutionConfig, count: int) -> Genome:
    return pose_variation(BOX, settings).create(key_of(1), count)


def created(config: EvolutionConfig, count: int) -> Genome:
    return creating(inputs(config), count)


@jax.jit
def crossed(settings: EvolutionConfig, keys: jax.Array, mother: Genome, father: Genome) -> Genome:
    cross = pose_variation(BOX, settings).cross
    return jax.vmap(cross, in_axes=(0, None, None))(keys, mother, father)


@jax.jit
def mutating(settings: EvolutionConfig, keys: jax.Array, genome: Genome) -> Genome:
    return jax.vmap(pose_variation(BOX, settings).mutate, in_axes=(0, None))(keys, genome)


def mutated(config: EvolutionConfig, genome: Genome) -> Genome:
    """200 mutants of one genome."""
    return mutating(inputs(config), keys(200), genome)


@pytest.mark.parametrize("initial", ["uniform", "latin"])
def test_initial_genomes_fill_the_box(initial: str):
    genomes = created(EvolutionConfig(initial=initial, initial_spread=1.0), 200)
    assert genomes.key_poses.shape == (200, K, J)
    assert inside(genomes)
    share = (genomes.key_poses - BOX.low.key_poses) / (BOX.high.key_poses - BOX.low.key_poses)
    assert np.allclose(jnp.mean(share, axis=0), 0.5, atol=0.1)
    assert np.allclose(jnp.std(share, axis=0), 12**-0.5, atol=0.05)


def test_a_latin_hypercube_has_one_value_in_each_slice():
    hypercube = jax.jit(variation.latin_hypercube, static_argnums=2)
    genomes = hypercube(key_of(1), BOX, 50)
    share = (genomes.key_poses - BOX.low.key_poses) / (BOX.high.key_poses - BOX.low.key_poses)
    slices = np.sort(np.floor(np.asarray(share).reshape(50, -1) * 50), axis=0)
    assert (slices == np.arange(50)[:, None]).all()


@pytest.mark.parametrize("crossing", ["permute", "align"])
def test_every_pose_of_a_child_is_one_of_a_parent(crossing: str):
    mother, father = (
        jax.tree.map(lambda leaf: leaf[0], variation.uniform(key, BOX, 1)) for key in keys(2)
    )
    children = crossed(inputs(EvolutionConfig(crossing=crossing)), keys(100), mother, father)
    both = np.concatenate([mother.key_poses, father.key_poses])
    places = np.array(
        [
            [np.flatnonzero((both == pose).all(axis=1))[0] for pose in child]
            for child in np.asarray(children.key_poses)
        ]
    )
    assert set(places.ravel()) == set(range(2 * K))
    if crossing == "permute":
        assert all(len(set(row)) == K for row in places)
    else:
        assert (places % K == np.arange(K)).all()
    assert np.all((children.tuning == mother.tuning) | (children.tuning == father.tuning))


@pytest.mark.parametrize("share", [0.25, 0.75])
def test_mixed_crossover_permutes_the_stated_share_of_children(share: float):
    """An aligned child has all poses in place; with K = 3 so has 1 in 15 permuted children."""
    mother, father = (
        jax.tree.map(lambda leaf: leaf[0], variation.uniform(key, BOX, 1)) for key in keys(2)
    )
    settings = inputs(EvolutionConfig(crossing="mixed", permuted=share))
    children = crossed(settings, keys(1000), mother, father).key_poses
    in_place = ((children == mother.key_poses) | (children == father.key_poses)).all(axis=(1, 2))
    assert abs(1 - float(in_place.mean()) - share * 14 / 15) < 0.05


@pytest.mark.parametrize("share", [0.25, 0.75])
def test_mixed_mutation_redraws_the_stated_share_of_mutants(share: float):
    genome = Genome(jnp.zeros((K, J)), jnp.zeros(E))
    settings = EvolutionConfig(mutation="mixed", redrawn=share, tuning_rate=0.0)
    changed = (mutated(settings, genome).key_poses != 0).sum(axis=(1, 2))
    assert abs(float((changed == 2).mean()) - share) < 0.1


@pytest.mark.parametrize(
    ("mutation", "changed"), [("redraw", 2), ("single", 1), ("pose", J), ("gaussian", J)]
)
def test_mutation_changes_one_pose_and_the_joint_count_of_its_kind(mutation: str, changed: int):
    genome = Genome(jnp.zeros((K, J)), jnp.full(E, 0.5).at[0].set(0.0))
    mutants = mutated(EvolutionConfig(mutation=mutation, tuning_rate=0.0), genome)
    differs = np.asarray(mutants.key_poses != genome.key_poses)
    assert (differs.any(axis=2).sum(axis=1) == 1).all()
    assert (differs.sum(axis=(1, 2)) == changed).all()
    assert inside(mutants)
    assert np.all(mutants.tuning == genome.tuning)


def test_each_mixed_mutant_has_one_kind_of_mutation():
    genome = Genome(jnp.zeros((K, J)), jnp.zeros(E))
    mutants = mutated(EvolutionConfig(mutation="mixed", tuning_rate=0.0), genome)
    differs = np.asarray(mutants.key_poses != 0)
    counts = np.bincount(differs.sum(axis=(1, 2)), minlength=J + 1)
    assert counts[2] + counts[J] == 200
    assert 70 < counts[2] < 130


def test_the_initial_spread_covers_the_middle_of_each_range():
    genomes = created(EvolutionConfig(initial_spread=0.5), 500)
    reach = np.abs(genomes.key_poses).max(axis=0) / BOX.high.key_poses
    assert ((reach > 0.45) & (reach <= 0.5)).all()
    assert float(genomes.tuning[:, 1:].min()) >= 0.25


def test_mutation_never_leaves_the_box():
    assert inside(mutated(EvolutionConfig(sigma=3.0, tuning_rate=1.0, tuning_sigma=3.0), BOX.high))


TWINS = Box({"a": jnp.zeros(50), "b": jnp.zeros(50)}, {"a": jnp.ones(50), "b": jnp.ones(50)})
"""Two arrays of equal shape and range."""


@pytest.mark.parametrize("draw", [variation.uniform, variation.latin_hypercube])
def test_arrays_of_equal_shape_are_drawn_independently(draw):
    drawn = draw(key_of(3), TWINS, 4)
    assert float(jnp.mean(drawn["a"] == drawn["b"])) < 0.1


def test_arrays_of_equal_shape_are_varied_independently():
    """Crossover and mutation choose different genes in each."""
    operators = variation.real_variation(TWINS, EvolutionConfig())
    child = operators.cross(key_of(4), TWINS.low, TWINS.high)
    assert 0.2 < float(jnp.mean(child["a"] == child["b"])) < 0.8
    middle = jax.tree.map(lambda leaf: leaf + 0.5, TWINS.low)
    mutant = operators.mutate(key_of(5), middle)
    moved = mutant["a"] != 0.5
    assert bool(moved.any())
    assert not bool((mutant["a"] == mutant["b"])[moved].any())


def test_duplicates_are_all_but_the_first_of_equal_genomes():
    rows = jnp.array([[1.0, 2], [3, 4], [1, 2], [1, 2.0001], [3, 4], [1, 2]])
    assert first_occurrence({"a": rows[:, :1], "b": rows[:, 1:]}).tolist() == [
        True,
        True,
        False,
        True,
        False,
        False,
    ]
