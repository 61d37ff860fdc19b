"""The evolution strategy: its formulas against another program's, and its place in a generation."""

import dataclasses
import itertools
from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cmaes import SepCMA
from evolution.test_evolution import BOX, advance, inputs, near_zero, run, toy

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.base import BodiedController
from mjxgait.controllers.key_poses.config import PoseConfig
from mjxgait.controllers.key_poses.controller import PoseTracker
from mjxgait.creature import Creature
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import Origin
from mjxgait.evolution.strategy import Normal, SeparableCma, reflected
from mjxgait.evolution.variation import Box, projected

GENES, CHILDREN = 8, 14
WIDE = Box(
    {"a": jnp.full((2, 2), -1.0), "b": jnp.full(4, 2.0)},
    {"a": jnp.full((2, 2), 3.0), "b": jnp.full(4, 12.0)},
)
"""A box of eight genes, of ranges 4 and 10."""
STRATEGY = SeparableCma(WIDE, 0.05)
draw = jax.jit(STRATEGY.draw, static_argnums=2)
learn = jax.jit(STRATEGY.learnt)


def points(genomes: dict) -> jax.Array:
    """Genomes [N, ...] in units of their ranges [N, n]."""
    a, b = (leaf.reshape(len(leaf), -1) for leaf in (genomes["a"], genomes["b"]))
    return jnp.concatenate([(a + 1) / 4, (b - 2) / 10], axis=1)


def genome(value: float) -> dict:
    """One genome [1, ...] at the same place of every range."""
    return {"a": jnp.full((1, 2, 2), 4 * value - 1), "b": jnp.full((1, 4), 10 * value + 2)}


def rotation() -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(0).normal(size=(GENES, GENES)))[0]


def ellipsoid(rows: jax.Array, optimum: float = 0.6) -> jax.Array:
    """A rotated ellipsoid; its longest axis is ten times its shortest."""
    axes = 10 ** np.linspace(0, 1, GENES)
    return -jnp.sum(((rows - optimum) @ rotation() * axes) ** 2, axis=-1)


def bowl(rows: jax.Array, optimum: float = 0.6) -> jax.Array:
    return -jnp.sum((rows - optimum) ** 2, axis=-1)


def rastrigin(rows: jax.Array, optimum: float = 0.6) -> jax.Array:
    away = 10 * (rows - optimum)
    return -jnp.sum(away**2 - 10 * jnp.cos(2 * np.pi * away) + 10, axis=-1)


def test_it_learns_as_another_program_does():
    """Both are told the same children; mean, step and variances stay the same."""
    own = STRATEGY.begun(genome(0.4))
    peer = SepCMA(np.full(GENES, 0.4), 0.05, population_size=CHILDREN)
    for key in jax.random.split(key_of(3), 25):
        children = draw(key, own, CHILDREN)
        rows = points(children)
        worth = ellipsoid(rows)
        own = learn(own, children, worth, worth)
        peer.tell([(np.float64(x), -float(y)) for x, y in zip(rows, worth, strict=True)])
        np.testing.assert_allclose(own.mean, peer.mean, atol=1e-4)
        np.testing.assert_allclose(own.step, peer._sigma, rtol=1e-3)
        np.testing.assert_allclose(own.variance, peer._C, rtol=1e-3)
    assert abs(peer._C - 1).max() > 0.3


@partial(jax.jit, static_argnums=(0, 1, 2))
def searched(
    worth: Callable[..., jax.Array], children: int, generations: int, optimum: float, start: float
) -> Normal:
    wide = dataclasses.replace(STRATEGY, first_step=0.3)

    def generation(normal: Normal, key: jax.Array) -> tuple[Normal, None]:
        drawn = wide.draw(key, normal, children)
        fitness = worth(points(drawn), optimum)
        return wide.learnt(normal, drawn, fitness, fitness), None

    keys = jax.random.split(key_of(1), generations)
    return jax.lax.scan(generation, wide.begun(genome(start)), keys)[0]


@pytest.mark.parametrize(
    ("worth", "children", "optimum"),
    [(bowl, 14, 0.6), (bowl, 200, 1.0), (ellipsoid, 14, 0.6), (rastrigin, 200, 0.6)],
    ids=["bowl", "at a bound, many children", "rotated ellipsoid", "Rastrigin"],
)
def test_it_finds_the_optimum(worth: Callable[..., jax.Array], children: int, optimum: float):
    found = searched(worth, children, 150, optimum, 0.2)
    np.testing.assert_allclose(found.mean, optimum, atol=0.01)
    assert found.step * np.sqrt(np.max(found.variance)) < 0.05


def test_what_leaves_the_cube_is_reflected():
    given = jnp.array([-0.1, 0.0, 0.4, 1.0, 1.2, 2.3, -1.3])
    np.testing.assert_allclose(reflected(given), [0.1, 0, 0.4, 1, 0.8, 0.3, 0.7], atol=1e-6)


@jax.jit
def with_a_fixed_gene() -> tuple[dict, Normal, Normal]:
    """Children of a box with one, and what is learnt from them with it and without."""
    fixed = SeparableCma(Box(WIDE.low | {"c": jnp.ones(2)}, WIDE.high | {"c": jnp.ones(2)}), 0.5)
    plain, normal = SeparableCma(WIDE, 0.5), fixed.begun(genome(0.1) | {"c": jnp.ones((1, 2))})
    drawn = fixed.draw(key_of(0), normal, CHILDREN)
    alone = {name: drawn[name] for name in ("a", "b")}
    worth = bowl(points(alone))
    without = plain.learnt(plain.begun(genome(0.1)), alone, worth, worth)
    return drawn, fixed.learnt(normal, drawn, worth, worth), without


def test_children_lie_in_the_box_and_a_fixed_gene_changes_nothing():
    """A gene without a range counts neither in a path's length nor in the rates."""
    drawn, with_it, without = jax.device_get(with_a_fixed_gene())
    for name in ("a", "b"):
        assert np.all((WIDE.low[name] <= drawn[name]) & (drawn[name] <= WIDE.high[name]))
    assert np.all(drawn["c"] == 1)
    np.testing.assert_allclose(with_it.step, without.step, rtol=1e-6)
    np.testing.assert_allclose(with_it.mean[:GENES], without.mean, rtol=1e-6)


def test_those_that_did_not_run_every_trial_follow_by_their_first():
    """Among the others the first trial says nothing: here it would turn their order round."""
    normal = STRATEGY.begun(genome(0.4))
    children = draw(key_of(2), normal, CHILDREN)
    worth = bowl(points(children))
    promoted = worth >= jnp.sort(worth)[-3]
    first = jnp.where(promoted, -worth, worth)
    told = learn(normal, children, jnp.where(promoted, worth, -jnp.inf), first)
    np.testing.assert_array_equal(told.mean, learn(normal, children, worth, worth).mean)


ES = toy(search="es", family=0.5)
"""All its runs have a curriculum, which changes nothing until trials become harder: one program."""


def test_a_run_begins_around_the_best_and_finds_the_optimum():
    history = run(ES, 60, has_curriculum=True)
    first, last = history[0][0], history[-1][0]
    np.testing.assert_allclose(
        first.normal.mean[:-1], (first.genomes.key_poses[0].ravel() + 1) / 2, atol=1e-6
    )
    best = [float(metrics.best) for _, metrics in history]
    assert all(later >= earlier for earlier, later in itertools.pairwise(best))
    assert best[-1] > -1e-6
    assert not any(metrics.forced for _, metrics in history)
    assert set(last.origin[last.born > 0]) == {int(Origin.DRAWN)}


def test_it_learns_nothing_where_the_old_are_evaluated_again():
    given, state = inputs(ES), run(ES, 3, has_curriculum=True)[-1][0]
    assert state.normal.updates == 2
    harder = dataclasses.replace(state, stale=jnp.ones((), bool))
    again = advance(*given, harder)[0].normal
    for old, new in zip(*map(jax.tree.leaves, (state.normal, again)), strict=True):
        np.testing.assert_array_equal(old, new)
    assert advance(*given, state)[0].normal.updates == 3


def test_it_learns_from_children_not_from_the_elite():
    keeping = toy(search="es", survival="children", elite=0.15)
    (before, _), given = run(keeping, 4)[-1], inputs(keeping)
    after, _, births = jax.device_get(advance(*given, before))
    children = jax.tree.map(lambda leaf: leaf[3:], births)
    worth = near_zero(children)
    wanted = jax.jit(SeparableCma(BOX, keeping.config.sigma).learnt)(
        before.normal, children, worth, worth
    )
    np.testing.assert_allclose(after.normal.mean, wanted.mean, atol=1e-6)
    np.testing.assert_allclose(after.normal.step, wanted.step, rtol=1e-5)


def test_body_sizes_are_genes_too(stool: Creature):
    controller = BodiedController(PoseTracker(stool, 0.005), 2, 1.25)
    box = controller.variation(PoseConfig(), EvolutionConfig(body=1.25)).box
    assert box is not None
    np.testing.assert_allclose(box.high.sizes, [np.log(1.25)] * 2)
    np.testing.assert_allclose(
        box.low.plan.tuning, PoseTracker(stool, 0.005).bounds(PoseConfig())[0].tuning
    )


def test_drawn_children_have_the_relations_among_genes_that_bred_ones_have():
    """A distribution knows only single genes; `Variation.project` relates them."""
    state = run(ES, 3, has_curriculum=True)[-1][0]
    upward = projected(
        ES.variation, lambda genome: dataclasses.replace(genome, key_poses=abs(genome.key_poses))
    )
    children, origins, _ = dataclasses.replace(ES, variation=upward)._children(key_of(1), state)
    assert set(np.asarray(origins)) == {int(Origin.DRAWN)}
    assert np.all(children.key_poses >= 0)
    free, _, _ = ES._children(key_of(1), state)
    np.testing.assert_array_equal(children.key_poses, abs(free.key_poses))


def test_too_few_children_are_refused():
    with pytest.raises(ValueError, match="at least 2 children"):
        EvolutionConfig(search="es", population=3, growth=1.4)
