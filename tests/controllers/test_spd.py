"""Stable PD of the rollout against float64 formulas, and where plain PD fails."""

import dataclasses
import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from helpers import STOOL, small_config

from mjxgait.controllers.spd import Rules, limited_torque, pd_force
from mjxgait.creature import Creature, load_creature
from mjxgait.simulation.rollout import Simulator
from mjxgait.training.experiment import build_experiment
from mjxgait.types import BodyState

SLIM = {"xla_backend_optimization_level": 0}
"""Most of the time here is compilation."""


def reference(mass, bias, q, v, target, kp, kd, limit, h, dofs, constraint) -> np.ndarray:
    """Tan, Liu & Turk 2011 in float64 over all freedoms; unactuated ones have zero gain."""
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


@dataclasses.dataclass(frozen=True)
class Case:
    """A moment of a falling, moving stool under one control law."""

    stable: bool = True
    counts: bool = False
    stiffness: float = 1.0
    damping: float = 1.0
    seed: int = 0


CASES = {
    "as shipped": Case(),
    "another moment": Case(seed=1),
    "with constraint forces": Case(counts=True),
    "soft and slow": Case(stiffness=0.2, damping=3.0, counts=True, seed=2),
    "at its limit": Case(stiffness=4.0, seed=3),
    "plain": Case(stable=False, counts=True, seed=4),
}
H, TARGET = 0.005, np.array([0.3, -0.2, 0.1, 0.4])


def moment(creature: Creature, case: Case) -> tuple[mujoco.MjData, np.ndarray]:
    """The state in C MuJoCo, and the constraint force [nv] of the previous step."""
    rng, data = np.random.default_rng(case.seed), mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    data.qpos[2] += 0.5
    data.qpos[creature.joints.qpos_adr] += rng.uniform(-0.5, 0.5, 4)
    data.qvel[:] = rng.uniform(-1, 1, creature.model.nv)
    mujoco.mj_forward(creature.model, data)
    return data, rng.uniform(-5, 5, creature.model.nv)


def wanted(creature: Creature, case: Case) -> np.ndarray:
    """The torque [J] from the paper, or from the textbook for plain PD."""
    (data, constraint), joints = moment(creature, case), creature.joints.dof_adr
    q, v = data.qpos[creature.joints.qpos_adr], data.qvel[joints]
    kp, kd, limit = (
        case.stiffness * creature.gains.kp,
        case.damping * creature.gains.kd,
        creature.gains.torque_limit,
    )
    if not case.stable:
        return np.clip(-kp * (q - TARGET) - kd * v, -limit, limit)
    mass = np.zeros((creature.model.nv, creature.model.nv))
    mujoco.mj_fullM(creature.model, data, mass)
    counted = constraint if case.counts else np.zeros_like(constraint)
    bias = data.qfrc_bias - data.qfrc_passive
    return reference(mass, bias, q, v, TARGET, kp, kd, limit, H, joints, counted)


def rules(cases: list[Case]) -> Rules:
    """The rollout's rules, [L]."""
    return Rules(
        stable=jnp.array([case.stable for case in cases]),
        constraint_forces=jnp.array([case.counts for case in cases]),
        stiffness=jnp.array([case.stiffness for case in cases]),
        damping=jnp.array([case.damping for case in cases]),
    )


def simulator_of(creature: Creature, physics: str) -> Simulator:
    return build_experiment(creature, small_config(rollout={"physics": physics})).simulator


@pytest.fixture(scope="module", params=["auto", "mjx"], ids=["the fast step", "plain MJX"])
def torques(request: pytest.FixtureRequest, stool: Creature) -> dict[str, np.ndarray]:
    """The rollout's torque in every case; all cases are lanes of one program."""
    simulator, cases = simulator_of(stool, request.param), list(CASES.values())
    lanes = simulator.plant.lane_axis
    moments = [moment(stool, case) for case in cases]
    arrays = [
        [data.qpos for data, _ in moments],
        [data.qvel for data, _ in moments],
        np.zeros((len(cases), stool.model.nv)),
        [constraint for _, constraint in moments],
    ]
    arrays = [jnp.moveaxis(jnp.asarray(rows, jnp.float32), 0, lanes) for rows in arrays]
    state = BodyState(*arrays, jnp.ones(len(cases)))

    def torque(state: BodyState, rules: Rules, target: jax.Array) -> jax.Array:
        sensed, step_data = simulator.plant.forward(state)
        return simulator.drive.torque(simulator.plant, rules, state, sensed, step_data, target)

    target = jnp.moveaxis(jnp.tile(jnp.float32(TARGET), (len(cases), 1)), 0, lanes)
    program = jax.jit(torque).lower(state, rules(cases), target).compile(compiler_options=SLIM)
    found = program(state, rules(cases), target)
    return dict(zip(CASES, np.asarray(jnp.moveaxis(found, lanes, 0)), strict=True))


@pytest.mark.parametrize("name", CASES)
def test_agrees_with_the_paper_in_float64(
    stool: Creature, torques: dict[str, np.ndarray], name: str
):
    np.testing.assert_allclose(torques[name], wanted(stool, CASES[name]), rtol=2e-4, atol=2e-4)


def test_some_cases_reach_the_torque_limit_and_some_do_not(stool: Creature):
    share = {
        name: np.abs(wanted(stool, case)) / stool.gains.torque_limit for name, case in CASES.items()
    }
    assert (share["at its limit"] == 1).any()
    assert (share["soft and slow"] < 1).all()


def test_the_torque_limit_is_applied_last():
    """Damping acts on the limited torque; clamping earlier would be another controller."""
    pos, vel, target = np.array([0.0]), np.array([0.0]), np.array([1.0])
    force = pd_force(pos, vel, target, np.array([100.0]), np.array([1.0]), 0.01)
    limited = limited_torque(force, np.array([2000.0]), np.array([0.01]), np.array([50.0]))
    assert float(limited[0]) == 50.0


@pytest.fixture(scope="module")
def stiff(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    """The stool with damping that explicit integration cannot handle at its time step."""
    folder: Path = tmp_path_factory.mktemp("spd") / "stool"
    shutil.copytree(STOOL, folder)
    for file, edits in {
        "creature.xml": (('timestep="0.005"', 'timestep="0.01"'),),
        "creature.toml": (
            ("kp = 40.0", "kp = 400.0"),
            ("kd = 2.0", "kd = 20.0"),
            ("= 20.0", "= 1e6"),
        ),
    }.items():
        text = (folder / file).read_text()
        for old, new in edits:
            text = text.replace(old, new)
        (folder / file).write_text(text)
    return load_creature(folder)


def test_stable_pd_stands_where_plain_pd_diverges(stiff: Creature):
    """One second on the floor with the rollout's torque and physics: one lane stable, one plain."""
    simulator, lanes = simulator_of(stiff, "auto"), [Case(stable=True), Case(stable=False)]
    law, target = rules(lanes), jnp.tile(jnp.float32(stiff.joints.stand)[:, None], 2)

    def step(state: BodyState) -> tuple[BodyState, jax.Array]:
        sensed, step_data = simulator.plant.forward(state)
        torque = simulator.drive.torque(simulator.plant, law, state, sensed, step_data, target)
        force = jnp.zeros((stiff.model.nv, 2)).at[stiff.joints.dof_adr].set(torque)
        return simulator.plant.advance(state, step_data, force), sensed.joint_vel

    still = jnp.zeros((stiff.model.nv, 2))
    qpos = jnp.tile(jnp.float32(stiff.stand_qpos)[:, None], 2)
    state, fastest = BodyState(qpos, still, still, still, jnp.ones(2)), np.zeros(2)
    program = jax.jit(step).lower(state).compile(compiler_options=SLIM)
    for k in range(100):
        state, speed = program(state)
        if k >= 50:
            fastest = np.maximum(fastest, np.abs(speed).max(axis=0))
    assert fastest[0] < 0.5
    assert not fastest[1] < 50
