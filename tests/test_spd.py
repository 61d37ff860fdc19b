"""Stable PD against float64 formulas, and where plain PD fails."""

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from mjxgait.creature import Creature
from mjxgait.spd import limited_torque, pd_force, stable_pd


def reference(mass, bias, q, v, target, kp, kd, limit, h, dofs, constraint) -> np.ndarray:
    """Tan, Liu & Turk 2011 in float64 over all degrees of freedom, the unactuated ones with zero gain."""
    nv = len(bias)
    kp_full, kd_full, q_full, v_full, target_full = (np.zeros(nv) for _ in range(5))
    kp_full[dofs], kd_full[dofs], q_full[dofs], v_full[dofs], target_full[dofs] = (
        kp,
        kd,
        q,
        v,
        target,
    )
    p = -kp_full * (q_full + h * v_full - target_full)
    d = -kd_full * v_full
    acceleration = np.linalg.inv(mass + h * np.diag(kd_full)) @ (p + d - bias + constraint)
    return np.clip((p + d - h * kd_full * acceleration)[dofs], -limit, limit)


@pytest.fixture(scope="module")
def moment(stool: Creature) -> dict[str, np.ndarray]:
    """A moment of a falling, moving stool, in float64."""
    rng = np.random.default_rng(3)
    data = mujoco.MjData(stool.model)
    data.qpos[:] = stool.stand_qpos
    data.qpos[2] += 0.5
    data.qpos[stool.qpos_adr] += rng.uniform(-0.5, 0.5, 4)
    data.qvel[:] = rng.uniform(-1, 1, stool.model.nv)
    mujoco.mj_forward(stool.model, data)
    mass = np.zeros((stool.model.nv, stool.model.nv))
    mujoco.mj_fullM(stool.model, data, mass)
    return {
        "mass": mass,
        "bias": data.qfrc_bias,
        "q": data.qpos[stool.qpos_adr],
        "v": data.qvel[stool.dof_adr],
    }


@pytest.mark.parametrize(
    "force", [0.0, 5.0], ids=["without constraint forces", "with them, as in DART's tutorial"]
)
@pytest.mark.parametrize("limit", [1e9, 3.0], ids=["unlimited", "limited"])
def test_agrees_with_the_paper_in_float64(
    stool: Creature, moment: dict, force: float, limit: float
):
    constraint = force * np.linspace(-1, 1, stool.model.nv)
    target = np.array([0.3, -0.2, 0.1, 0.4])
    state, limits = (moment["mass"], moment["bias"], moment["q"], moment["v"]), np.full(4, limit)
    arguments = (*state, target, stool.kp, stool.kd, limits, 0.005, stool.dof_adr)
    torque = stable_pd(*(jnp.asarray(a) for a in arguments), constraint)
    assert np.allclose(torque, reference(*arguments, constraint), rtol=2e-4, atol=2e-4)


def test_the_limit_comes_last():
    """The damping that counts is that of the limited torque, so clamping before it would be another controller."""
    force = pd_force(
        np.array([0.0]), np.array([0.0]), np.array([1.0]), np.array([100.0]), np.array([1.0]), 0.01
    )
    assert (
        float(limited_torque(force, np.array([2000.0]), np.array([0.01]), np.array([50.0]))[0])
        == 50.0
    )


def stand(creature: Creature, stable: bool, kp: float, kd: float, h: float) -> float:
    """Fastest joint in rad/s over the last half of a second of standing on the floor in C MuJoCo."""
    model = mujoco.MjModel.from_xml_string(creature.files["creature.xml"])
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[:] = creature.stand_qpos
    dofs, fastest = creature.dof_adr, 0.0
    gains, limit = (np.full(4, kp), np.full(4, kd)), np.full(4, 1e6)
    mass = np.zeros((model.nv, model.nv))
    for step in range(round(1.0 / h)):
        mujoco.mj_forward(model, data)
        q, v = data.qpos[creature.qpos_adr], data.qvel[dofs]
        if stable:
            mujoco.mj_fullM(model, data, mass)
            torque = reference(
                mass, data.qfrc_bias, q, v, creature.stand, *gains, limit, h, dofs, 0.0
            )
        else:
            torque = -kp * (q - creature.stand) - kd * v
        data.qfrc_applied[dofs] = torque
        mujoco.mj_step(model, data)
        if not np.isfinite(data.qvel).all() or np.abs(data.qvel).max() > 1e3:
            return np.inf
        if step * h > 0.5:
            fastest = max(fastest, float(np.abs(data.qvel[dofs]).max()))
    return fastest


def test_stands_where_plain_pd_blows_up(stool: Creature):
    """On the floor, with a damping that explicit integration cannot bear at this step."""
    assert stand(stool, stable=True, kp=400.0, kd=20.0, h=0.01) < 0.5
    assert stand(stool, stable=False, kp=400.0, kd=20.0, h=0.01) > 50
