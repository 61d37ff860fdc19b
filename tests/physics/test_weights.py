"""Quantities derived from masses match MuJoCo, in both plants."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from jax.tree_util import keystr
from many_bodies import XML, heavier_model, layout_of, stacked, varied

from mjxgait.creature import Creature
from mjxgait.physics.derived import observation_layout
from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.physics.mjx import mjx_plant
from mjxgait.types import Plant

MODELS = [varied(XML, seed) for seed in (3, 4)]


PLANTS = {"fast": lane_major_plant, "mjx": mjx_plant}
SCALAR = pytest.mark.thorough("a factor per body is compared on MJX, and one for all on the other")


@pytest.fixture(scope="module", params=PLANTS)
def plant(request: pytest.FixtureRequest) -> Plant:
    return PLANTS[request.param](MODELS[0], layout_of(MODELS[0]))


@pytest.fixture(scope="module")
def with_mass_scale(plant: Plant) -> Callable[..., Any]:
    """The plant's function, compiled once for all numbers."""
    return jax.jit(plant.with_mass_scale)


def assert_same(ours: Any, theirs: Any) -> None:
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(ours), jax.tree.leaves(theirs), strict=True
    ):
        most = 1e-5 * np.abs(b).max(initial=1e-9)
        np.testing.assert_allclose(a, b, rtol=0, atol=most, err_msg=keystr(path))


def factors(model: mujoco.MjModel, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.4, 2.5, model.nbody - 1)


@pytest.mark.parametrize("model", MODELS)
def test_scaled_masses_match_mujoco(
    plant: Plant, with_mass_scale: Callable[..., Any], model: mujoco.MjModel
):
    factor, layout = factors(model, 5), layout_of(model)
    ours = with_mass_scale(plant.parameters_of(model, layout), jnp.float32(factor))
    assert_same(ours, plant.parameters_of(heavier_model(model, factor), layout))


@pytest.mark.parametrize("plant", ["fast", pytest.param("mjx", marks=SCALAR)], indirect=True)
def test_one_factor_scales_all_bodies(plant: Plant, with_mass_scale: Callable[..., Any]):
    ours = with_mass_scale(plant.parameters, 1.3)
    model = heavier_model(MODELS[0], 1.3)
    assert_same(ours, plant.parameters_of(model, layout_of(model)))


def test_a_mass_scale_per_lane(plant: Plant):
    """Many factors at once are one `vmap`, with the lanes where the plant has them."""
    rows = np.stack([factors(MODELS[0], seed) for seed in range(3)])
    every = jax.jit(jax.vmap(lambda f: plant.with_mass_scale(plant.parameters, f)))(
        jnp.float32(rows)
    )
    variants = [heavier_model(MODELS[0], row) for row in rows]
    assert_same(every, stacked([plant.parameters_of(m, layout_of(m)) for m in variants]))


def test_constraint_weights_follow_the_masses(plant: Plant, with_mass_scale: Callable[..., Any]):
    """Half the mass doubles the inverse mass, except for rotors."""
    half = jnp.float32(np.full(MODELS[0].nbody - 1, 0.5))
    before = plant.parameters_of(MODELS[0], layout_of(MODELS[0]))
    after = with_mass_scale(before, half)
    if plant.lane_axis:
        ratio = np.asarray(after.contacts.weight) / before.contacts.weight
    else:
        ratio = after.model["body_invweight0"][1:] / before.model["body_invweight0"][1:]
    assert np.all((ratio > 1.2) & (ratio < 2.01))


OTHERS = ("alien", "crab", "duck", "short_quadruped", "tall_quadruped")
MORE = [pytest.param(name, marks=pytest.mark.thorough("another body")) for name in OTHERS]


@pytest.mark.parametrize("shipped", ["luxo", *MORE], indirect=True)
def test_shipped_creatures_scale_like_mujoco(shipped: Creature):
    model, layout = shipped.evolution_model, observation_layout(shipped)
    factor = factors(model, 6)
    plant = lane_major_plant(model, layout)
    ours = jax.jit(plant.with_mass_scale)(plant.parameters, jnp.float32(factor))
    assert_same(ours, plant.parameters_of(heavier_model(model, factor), layout))
