"""The ground in JAX: smooth, level at the start, and equal to the reference simulator's."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import small_config

from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.creature.creature import start_place
from mjxgait.creature.ground.spec import parse_ground
from mjxgait.creature.ground.surface import (
    Ground,
    contact,
    height,
    lay_ground,
    lay_uneven,
    named_draws,
    normal,
    pulled,
)
from mjxgait.evolution.chance import key_of
from mjxgait.reference.starts import _gravity
from mjxgait.reference.terrain import terrain_of
from mjxgait.tasks.starts import Starts, draw_grounds, draw_starts

TEXTS = (
    "slope:0.2",
    "slope:0.2:down",
    "slope:0.2:across",
    "steps:0.1",
    "steps:0.1:down@2",
    "bumps:0.1",
    "rough:0.1",
    "rough:0.1@5",
)


def drawn(creature: Creature, config: RolloutConfig) -> Starts:
    """Starts, the ground compiled as a whole: otherwise hundreds of operations compile alone."""
    level = dataclasses.replace(config, ground="flat", slope=0.0, rough=0.0)
    lay = jax.jit(lambda key: draw_grounds(jax.random.fold_in(key, 2), creature, config))
    starts = draw_starts(key_of(0), creature, level)
    return dataclasses.replace(starts, ground=lay(key_of(0)))


def laid(creature: Creature, text: str) -> Ground:
    spec = creature.on(text).terrain
    ground = lay_ground(spec, start_place(creature), named_draws(spec.seed))
    assert ground is not None
    return ground


def places(creature: Creature, reach: float, count: int = 400) -> np.ndarray:
    """Random places [2, count] in m, within `reach` body lengths of the start."""
    rng = np.random.default_rng(0)
    around = rng.uniform(-1, 1, (2, count)) * reach * creature.frame.body_length
    return around + creature.frame.stand_pos[:2, None]


@pytest.mark.parametrize("text", TEXTS)
def test_heights_match_the_reference_simulator(stool: Creature, text: str):
    x, y = places(stool, 30.0)
    theirs = terrain_of(stool.on(text))
    assert theirs is not None
    ours = np.asarray(height(laid(stool, text), x, y))
    assert np.ptp(ours) > 0.01
    np.testing.assert_allclose(ours, theirs.height(x, y), atol=2e-5)


def test_uneven_ground_is_rough_under_the_gravity_of_a_slope(stool: Creature):
    """Heights are those of the named ground, gravity that of the examination's slopes."""
    x, y = places(stool, 10.0)
    place = start_place(stool)._replace(forward=np.array([0.6, 0.8, 0.0]))
    rough = lay_ground(parse_ground("rough:0.1"), place, named_draws(0))
    for slope in ((-0.2, 0.0), (0.0, 0.2), (0.1, -0.1), (0.0, 0.0)):
        ground = lay_uneven(place, slope, 0.1, named_draws(0))
        np.testing.assert_array_equal(height(ground, x, y), height(rough, x, y))
        angle, (ahead, left) = np.arctan(np.hypot(*slope)), slope
        way = np.array([0.6 * ahead - 0.8 * left, 0.8 * ahead + 0.6 * left])
        rise = way * angle / (np.hypot(*slope) or 1.0)
        theirs = _gravity(stool.model, rise[None])[0]
        np.testing.assert_allclose(pulled(ground, (0.0, 0.0, -9.81)), theirs, atol=1e-5)


def test_perturbed_starts_have_their_own_uneven_ground(stool: Creature):
    """The nominal start is always level. No two others are the same, none is too steep."""
    config = dataclasses.replace(small_config().rollout, starts=6, slope=10.0)
    ground = drawn(stool, config).ground
    assert ground is not None
    far = 20 * stool.frame.body_length * jnp.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    x, y = far + stool.frame.stand_pos[:2, None]
    far_off = jax.jit(jax.vmap(lambda each: height(each, x, y)))
    down = np.asarray(ground.down)
    assert not np.asarray(far_off(ground)).any()
    np.testing.assert_array_equal(down[0], [0.0, 0.0, -1.0])
    steep = np.degrees(np.arccos(-down[1:, 2]))
    assert 0 < steep.min() < steep.max() <= 10.0
    # Slopes spread evenly: in no direction do all rise or all fall.
    for direction in down[1:, :2].T:
        assert direction.min() < 0 < direction.max()
    rough = dataclasses.replace(config, slope=0.0, rough=0.1)
    ground = drawn(stool, rough).ground
    np.testing.assert_array_equal(ground.down, np.tile([0.0, 0.0, -1.0], (6, 1)))
    heights = np.asarray(far_off(ground))
    assert not heights[0].any()
    assert 0 < np.abs(heights).max() <= 0.1 * stool.frame.hip_height


@pytest.mark.parametrize("text", TEXTS)
def test_the_normal_matches_the_gradient_of_the_heights(stool: Creature, text: str):
    """Also where a creature starts at an angle."""
    ground = dataclasses.replace(laid(stool, text), forward=jnp.float32([0.6, 0.8]))
    x, y = (jnp.asarray(p, jnp.float32) for p in places(stool, 6.0))
    gradient = jax.vmap(jax.grad(lambda at: height(ground, at[0], at[1])))(jnp.stack([x, y], 1))
    wanted = jnp.stack([-gradient[:, 0], -gradient[:, 1], jnp.ones_like(x)])
    wanted = wanted / jnp.linalg.norm(wanted, axis=0)
    np.testing.assert_allclose(jnp.stack(normal(ground, x, y)), wanted, atol=2e-5)
    assert wanted[2].min() < 0.999


@pytest.mark.parametrize("text", TEXTS)
def test_the_ground_is_level_at_the_start(stool: Creature, text: str):
    ground = laid(stool, text)
    x, y = places(stool, 0.7)
    np.testing.assert_array_equal(height(ground, x, y), 0.0)
    np.testing.assert_array_equal(normal(ground, x, y)[2], 1.0)


def test_the_ground_is_as_high_and_as_steep_as_requested(stool: Creature):
    forward, left = start_place(stool).forward, np.array([0.0, 1.0])
    far = stool.frame.stand_pos[:2] + 10 * stool.frame.body_length * forward[:2]

    def rise(text: str, way: np.ndarray) -> float:
        """Rise in m over the displacement `way`."""
        there, here = (height(laid(stool, text), *at) for at in (far + way, far))
        return float(there - here)

    assert rise("slope:0.2", forward[:2]) == pytest.approx(0.2, abs=1e-4)
    assert rise("slope:0.2:down", forward[:2]) == pytest.approx(-0.2, abs=1e-4)
    assert rise("slope:0.2:across", left) == pytest.approx(0.2, abs=1e-4)
    assert rise("steps:0.1", stool.frame.hip_height * forward[:2]) == pytest.approx(
        0.1 * stool.frame.hip_height, abs=1e-4
    )
    for text in ("bumps:0.1", "rough:0.1"):
        highest = np.abs(height(laid(stool, text), *places(stool, 20.0, 20_000))).max()
        assert 0.08 * stool.frame.hip_height < highest <= 0.1 * stool.frame.hip_height


def test_trials_have_their_own_ground_starting_with_the_named_one(stool: Creature):
    config = small_config(rollout={"ground": "rough:0.1@5", "starts": 3}).rollout
    ground = drawn(stool, config).ground
    x, y = places(stool, 20.0)
    heights = jax.vmap(lambda each: height(each, x, y))(ground)
    np.testing.assert_allclose(heights[0], height(laid(stool, "rough:0.1@5"), x, y), atol=1e-6)
    assert np.abs(heights[1] - heights[2]).max() > 0.01
    again = drawn(stool, config).ground
    for one, other in zip(jax.tree.leaves(ground), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, other)


def test_other_draws_do_not_change_with_the_ground(stool: Creature):
    flat, rough = (
        drawn(stool, small_config(rollout={"ground": text}).rollout)
        for text in ("flat", "rough:0.1")
    )
    assert flat.ground is None
    for name in ("qpos", "qvel", "friction", "push", "push_step", "stiffness", "damping"):
        np.testing.assert_array_equal(getattr(flat, name), getattr(rough, name))


@pytest.mark.parametrize("text", TEXTS)
def test_sphere_distance_is_to_the_nearest_ground_point(stool: Creature, text: str):
    """Against the nearest of many points of the reference simulator's ground."""
    theirs = terrain_of(stool.on(text))
    assert theirs is not None
    radius, (x, y) = 0.03, places(stool, 6.0, 60)
    z = theirs.height(x, y) + np.random.default_rng(1).uniform(0.8, 1.5, 60) * radius
    near = np.stack(np.meshgrid(*[np.linspace(-0.05, 0.05, 101)] * 2), -1).reshape(-1, 2).T
    px, py = x + near[0][:, None], y + near[1][:, None]
    apart = np.sqrt((px - x) ** 2 + (py - y) ** 2 + (theirs.height(px, py) - z) ** 2).min(0)
    found = contact(laid(stool, text), x, y, z, radius)
    # A step's edge is as sharp as the sphere: two iterations do not quite find the nearest point.
    tolerance = 2e-3 if "steps" in text else 5e-4
    np.testing.assert_allclose(found.distance, apart - radius, atol=tolerance)
    axes = jnp.stack([jnp.stack(axis) for axis in found[1:]])
    np.testing.assert_allclose(
        jnp.einsum("ain,bin->nab", axes, axes), np.tile(np.eye(3), (60, 1, 1)), atol=1e-5
    )
    assert (jnp.linalg.det(jnp.moveaxis(axes, -1, 0)) > 0.99).all()
