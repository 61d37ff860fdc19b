"""A drop onto rough ground in lane-major physics, against C MuJoCo with a height field.

Contacts differ: a foot meets several triangles of the field, but one plane in lane-major
physics. The motion must agree.
"""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from many_bodies import SLIM

from mjxgait.creature import Creature
from mjxgait.creature.creature import start_place
from mjxgait.creature.ground.surface import lay_ground, named_draws
from mjxgait.physics import make_plant
from mjxgait.reference.stepping import examined_model
from mjxgait.reference.terrain import terrain_of
from mjxgait.types import BodyState

LANES = 8
STEPS = 100
DROP = 0.02
"""m, height of the drop."""


def held(creature: Creature, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
    """Torques [nv, ...] towards the standing pose, from states [nq, ...] and [nv, ...]."""
    over = (slice(None), *(None,) * (qpos.ndim - 1))
    force = np.zeros(qvel.shape)
    away = creature.joints.stand[over] - qpos[creature.joints.qpos_adr]
    force[creature.joints.dof_adr] = (
        creature.gains.kp[over] * away - creature.gains.kd[over] * qvel[creature.joints.dof_adr]
    )
    return force


def test_creatures_come_to_rest_at_the_same_place(stool: Creature):
    creature = stool.on("rough:0.1")
    terrain, spec = terrain_of(creature), creature.terrain
    assert terrain is not None
    qpos = np.tile(creature.stand_qpos[:, None], LANES)
    qpos[0] += np.linspace(3, 8, LANES) * creature.frame.body_length
    qpos[1] += np.linspace(-1, 1, LANES)
    qpos[2] += terrain.height(qpos[0], qpos[1]) + DROP

    plant, _ = make_plant(creature, "auto", True)
    ground = lay_ground(spec, start_place(creature), named_draws(spec.seed))
    every = jax.tree.map(lambda leaf: jnp.tile(leaf[..., None], LANES), ground)
    still = jnp.zeros((creature.model.nv, LANES))
    state = BodyState(jnp.float32(qpos), still, still, still, jnp.ones(LANES), None, every)

    def step(state: BodyState, torque: jax.Array) -> BodyState:
        return plant.advance(state, plant.forward(state)[1], torque)

    compiled = jax.jit(step).lower(state, still).compile(compiler_options=SLIM)
    model, there = examined_model(creature), []
    for _ in range(STEPS):
        torque = held(creature, np.asarray(state.qpos), np.asarray(state.qvel))
        state = compiled(state, jnp.float32(torque))
    for lane in range(LANES):
        data = mujoco.MjData(model)
        data.qpos[:] = qpos[:, lane]
        for _ in range(STEPS):
            data.qfrc_applied[:] = held(creature, data.qpos, data.qvel)
            mujoco.mj_step(model, data)
        there.append(data.qpos)
    apart = np.abs(np.asarray(state.qpos) - np.transpose(there)).max(0)
    assert np.median(apart) < 0.004
    assert apart.max() < 0.03
    fallen = qpos[2] - np.asarray(state.qpos)[2]
    assert (fallen > 0).all()
    assert np.median(fallen) > 0.5 * DROP
