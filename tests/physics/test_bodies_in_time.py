"""Lanes with different bodies over many steps: variants of a shipped quadruped."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from many_bodies import compiled, heavier_model, stacked

from mjxgait.config.layers import find_creature
from mjxgait.creature import load_creature
from mjxgait.physics.derived import observation_layout
from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.types import BodyState, Plant


def after(plant: Plant, state: BodyState, torque: jax.Array, steps: int) -> np.ndarray:
    """qpos [L, nq] after `steps` steps under a constant torque [nv, L]."""

    def step(_: int, state: BodyState) -> BodyState:
        return plant.advance(state, plant.forward(state)[1], torque)

    def program(state: BodyState) -> BodyState:
        return jax.lax.fori_loop(0, steps, step, state)

    return np.asarray(compiled(program, state)(state).qpos).T


@pytest.fixture(scope="module")
def quadrupeds() -> list[mujoco.MjModel]:
    """The tall quadruped with changed masses, armatures and lengths."""
    model = load_creature(find_creature("tall_quadruped")).evolution_model
    rng, variants = np.random.default_rng(0), []
    for _ in range(4):
        variant = heavier_model(model, rng.uniform(0.7, 1.4, model.nbody - 1))
        variant.body_pos[2:] *= rng.uniform(0.9, 1.1, variant.body_pos[2:].shape)
        variant.dof_armature[6:] *= rng.uniform(0.7, 1.4, model.nv - 6)
        touching = variant.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
        variant.geom_size[touching, 0] *= rng.uniform(0.9, 1.1)
        mujoco.mj_setConst(variant, mujoco.MjData(variant))
        variants.append(variant)
    return variants


@pytest.mark.thorough("test_bodies.py has eighty steps of another body")
def test_variants_of_a_shipped_quadruped_match_c_mujoco(quadrupeds: list[mujoco.MjModel]):
    creature = load_creature(find_creature("tall_quadruped"))
    layout = observation_layout(creature)
    plant = lane_major_plant(creature.evolution_model, layout)
    numbers = stacked([plant.parameters_of(model, layout) for model in quadrupeds])
    qpos = np.tile(creature.stand_qpos, (4, 1))
    qpos[:, creature.joints.qpos_adr] += 0.1 * np.random.default_rng(1).normal(
        size=(4, len(creature.joints.qpos_adr))
    )
    qpos[:, 2] -= 0.01
    still = np.zeros((4, creature.model.nv))
    rows = BodyState(qpos, still, still, still, np.ones(4), numbers)
    state = jax.tree.map(lambda x: jnp.moveaxis(jnp.asarray(x, jnp.float32), 0, -1), rows)
    ours = after(plant, state, jnp.zeros_like(state.qvel), 20)
    for lane, model in enumerate(quadrupeds):
        data = mujoco.MjData(model)
        data.qpos[:] = np.float32(qpos[lane])
        mujoco.mj_step(model, data, 20)
        assert data.ncon > 0
        np.testing.assert_allclose(ours[lane], data.qpos, atol=2e-4)
