"""Blocks of two bodies that push each other, and a whole contest against C MuJoCo."""

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from mjxgait.controllers.sims_brain.reference_body import CUBE, CUBE_DENSITY
from mjxgait.physics.batched_trees.arena import cube_tree, resting
from mjxgait.physics.batched_trees.collision import Boxes, gap, pushes
from mjxgait.physics.batched_trees.dynamics import weighed
from mjxgait.physics.lane_major.lanes import pinned_by

LANES, STEP = 16, 0.01


def boxes(seed: int, count: int, apart: float = 0.3) -> Boxes:
    """Blocks [count, LANES] at random places within `apart` m, in random attitudes and motion."""
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(count, LANES, 3, 3)))[0]

    def vector(spread: float) -> tuple[jax.Array, jax.Array, jax.Array]:
        x, y, z = jnp.asarray(rng.uniform(-spread, spread, (3, count, LANES)), jnp.float32)
        return x, y, z

    def axis(number: int) -> tuple[jax.Array, jax.Array, jax.Array]:
        x, y, z = (jnp.asarray(axes[..., number, c], jnp.float32) for c in range(3))
        return x, y, z

    half = tuple(jnp.asarray(rng.uniform(0.05, 0.2, (count, LANES)), jnp.float32) for _ in range(3))
    mass = 8000 * half[0] * half[1] * half[2]
    return Boxes(
        vector(apart),
        (axis(0), axis(1), axis(2)),
        half,
        mass,
        jnp.ones((count, LANES)),
        vector(3.0),
        vector(1.0),
    )


def pushed(one: Boxes, other: Boxes) -> tuple[np.ndarray, np.ndarray]:
    """Moments and forces, [n, 6, L] and [m, 6, L]."""
    first, second = jax.jit(lambda a, b: pushes(a, b, STEP, pinned_by(a.mass[0])))(one, other)
    return np.asarray(first), np.asarray(second)


def test_two_bodies_push_each_other_alike():
    """Momentum and angular momentum stay: all forces cancel out, and so do all moments."""
    one, other = boxes(0, 3), boxes(1, 2)
    mine, its = pushed(one, other)
    assert (np.abs(mine[:, 3:]).max((0, 1)) > 1).mean() > 0.5
    np.testing.assert_allclose(mine[:, 3:].sum(0), -its[:, 3:].sum(0), rtol=1e-4, atol=1e-2)

    def about_origin(body: Boxes, force: np.ndarray) -> np.ndarray:
        middle = np.stack([np.asarray(c) for c in body.middle], axis=1)
        arms = np.cross(np.moveaxis(middle, 1, -1), np.moveaxis(force[:, 3:], 1, -1))
        return force[:, :3].sum(0) + np.moveaxis(arms, -1, 1).sum(0)

    total = about_origin(one, mine) + about_origin(other, its)
    assert np.abs(total).max() < 1e-4 * np.abs(mine).max()


def test_blocks_that_approach_are_pushed_apart_and_slowed():
    one, other = boxes(2, 1, 0.02), boxes(3, 1, 0.02)
    still = tuple(jnp.zeros((1, LANES)) for _ in range(3))
    place = (jnp.full((1, LANES), 0.15), *still[1:])
    one = dataclasses.replace(one, spin=still, drift=still)
    other = dataclasses.replace(other, middle=place, spin=still, drift=still)
    mine, _ = pushed(one, other)
    between = np.stack([np.asarray(a - b)[0] for a, b in zip(one.middle, place, strict=True)])
    touching = np.abs(mine[0, 3:]).max(0) > 0
    assert touching.mean() > 0.5
    assert ((mine[0, 3:] * between).sum(0)[touching] > 0).all()
    nearer = dataclasses.replace(one, drift=(jnp.full((1, LANES), 0.5), *still[1:]))
    faster, _ = pushed(nearer, other)
    assert (faster[0, 3] <= mine[0, 3] + 1e-3).all()
    assert (faster[0, 3] < mine[0, 3])[touching].all()


def test_blocks_that_are_apart_or_missing_push_nothing():
    one, other = boxes(4, 2, 0.1), boxes(5, 2, 0.1)
    far = dataclasses.replace(other, middle=(other.middle[0] + 3.0, *other.middle[1:]))
    assert not np.abs(pushed(one, far)[0]).any()
    missing = dataclasses.replace(other, solid=jnp.zeros((2, LANES)))
    mine, its = pushed(one, missing)
    assert not np.abs(mine).any()
    assert not np.abs(its).any()


def test_friction_stops_a_block_that_slides_on_another():
    """The force on it points against its slip, and is at most friction times the pressure."""
    still = tuple(jnp.zeros((1, LANES)) for _ in range(3))
    one = tuple(jnp.full((1, LANES), float(k)) for k in range(2))
    axes = (
        (one[1], one[0], one[0]),
        (one[0], one[1], one[0]),
        (one[0], one[0], one[1]),
    )
    half = tuple(jnp.full((1, LANES), 0.1) for _ in range(3))
    slab = Boxes(still, axes, half, 8 * one[1], one[1], still, still)
    above = (*still[:2], jnp.full((1, LANES), 0.19))
    slides = (jnp.linspace(-1, 1, LANES)[None], *still[1:])
    block = dataclasses.replace(slab, middle=above, drift=slides)
    force = pushed(block, slab)[0][0, 3:]
    speed = np.asarray(slides[0])[0]
    assert (force[2] > 0).all()
    assert (force[0] * speed <= 0).all()
    assert (np.abs(force[0]) <= 0.9 * force[2] * 1.001).all()
    assert np.abs(force[0][np.abs(speed) > 0.5]) == pytest.approx(0.9 * force[2][0], rel=1e-3)


def test_the_gap_is_the_distance_to_the_nearest_block():
    body, rng = boxes(6, 3, 0.6), np.random.default_rng(7)
    point = rng.uniform(-1, 1, (3, LANES)).astype(np.float32)
    found = np.asarray(gap(body, (point[0], point[1], point[2])))
    for lane in range(LANES):
        each = []
        for n in range(3):
            axes = np.array([[np.asarray(c)[n, lane] for c in axis] for axis in body.axes])
            middle = np.array([np.asarray(c)[n, lane] for c in body.middle])
            half = np.array([np.asarray(h)[n, lane] for h in body.half])
            local = axes @ (point[:, lane] - middle)
            each.append(np.linalg.norm(local - np.clip(local, -half, half)))
        assert found[lane] == pytest.approx(min(each), abs=1e-5)


def test_the_cube_weighs_as_any_body_of_its_shape():
    cube = cube_tree(CUBE, CUBE_DENSITY)
    known = weighed(cube)
    np.testing.assert_allclose(cube.body_weight[:1], known.body_weight[:1], rtol=1e-5)
    np.testing.assert_allclose(cube.dof_weight[:1], known.dof_weight[:1], rtol=1e-5)
    assert float(cube.mass.sum()) == pytest.approx(CUBE_DENSITY * CUBE**3)
    assert resting(cube, jnp.zeros(8)).qvel.shape == (7,)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><freejoint/><geom type="box" size="{CUBE / 2} {CUBE / 2} {CUBE / 2}"'
        f' density="{CUBE_DENSITY}"/></body></worldbody></mujoco>'
    )
    np.testing.assert_allclose(cube.inertia[0], model.body_inertia[1], rtol=1e-5)
