"""Lane-major physics in water, without gravity and floor, against C MuJoCo (float64)."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from many_bodies import SLIM, XML

from mjxgait.physics.derived import ObservationLayout
from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.types import BodyState

FLOOR = '<geom name="floor" type="plane" size="0 0 1" contype="1" friction="0.8" margin="0.002"/>'
LANES = 6
STEPS = 100


def swimmer(density: float, viscosity: float) -> mujoco.MjModel:
    option = f'<option density="{density}" viscosity="{viscosity}" gravity="0 0 0" '
    return mujoco.MjModel.from_xml_string(XML.replace(FLOOR, "").replace("<option ", option))


def states(model: mujoco.MjModel) -> tuple[BodyState, np.ndarray]:
    """Random torques, and states that tumble fast enough for density to matter."""
    rng = np.random.default_rng(1)
    qpos = np.tile(model.qpos0[:, None], LANES)
    qpos[3:7] = rng.normal(size=(4, LANES))
    qpos[7:] += rng.uniform(-0.3, 0.3, (model.nq - 7, LANES))
    for start in (3, model.jnt_qposadr[model.joint("tail").id]):
        qpos[start : start + 4] /= np.linalg.norm(qpos[start : start + 4], axis=0)
    qvel = 2.0 * rng.normal(size=(model.nv, LANES))
    torque = np.asarray(rng.normal(size=qvel.shape), np.float32)
    arrays = (qpos, qvel, 0 * qvel, 0 * qvel, np.ones(LANES))
    return BodyState(*(jnp.asarray(a, jnp.float32) for a in arrays)), torque


THICK = pytest.param((0.0, 3.0), marks=pytest.mark.thorough("the other fluid is viscous too"))


@pytest.fixture(scope="module", params=[(900.0, 0.3), THICK], ids=str)
def swim(request: pytest.FixtureRequest) -> SimpleNamespace:
    """One step and many steps of lane-major physics, and the same in C MuJoCo."""
    model = swimmer(*request.param)
    hinges = np.nonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)[0]
    trunk = model.body("trunk").id
    layout = ObservationLayout(
        trunk, model.jnt_qposadr[hinges], model.jnt_dofadr[hinges], np.array([model.geom("leg").id])
    )
    plant, (state, torque) = lane_major_plant(model, layout), states(model)

    def step(state: BodyState, torque: jax.Array) -> tuple[jax.Array, BodyState]:
        sensed, step_data = plant.forward(state)
        return sensed.bias, plant.advance(state, step_data, torque)

    compiled = jax.jit(step).lower(state, torque).compile(compiler_options=SLIM)
    bias, after = compiled(state, torque)
    later = after
    for _ in range(STEPS - 1):
        _, later = compiled(later, torque)
    return SimpleNamespace(
        model=model, layout=layout, state=state, torque=torque, bias=bias, after=after, later=later
    )


def in_c(swim: SimpleNamespace, lane: int, steps: int) -> mujoco.MjData:
    data = mujoco.MjData(swim.model)
    data.qpos[:], data.qvel[:] = swim.state.qpos[:, lane], swim.state.qvel[:, lane]
    data.qfrc_applied[:] = swim.torque[:, lane]
    mujoco.mj_step(swim.model, data, steps)
    return data


def close(ours: np.ndarray, theirs: np.ndarray, tolerance: float) -> None:
    """Equal within a share of the largest entry."""
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())


def test_one_step_matches_c_mujoco(swim: SimpleNamespace):
    for lane in range(LANES):
        data = in_c(swim, lane, 1)
        close(swim.bias[:, lane], data.qfrc_bias - data.qfrc_passive, 1e-5)
        close(swim.after.warmstart[:, lane], data.qacc, 2e-5)
        close(swim.after.qvel[:, lane], data.qvel, 1e-5)


def test_density_and_viscosity_both_matter(swim: SimpleNamespace):
    """Each property changes a step by a hundred times the tolerance of the comparison."""
    found, option = in_c(swim, 0, 1).qacc, swim.model.opt
    most = 2e-3 * np.abs(found).max()
    for density, viscosity in {(0.0, option.viscosity), (option.density, 0.0)}:
        if (density, viscosity) != (option.density, option.viscosity):
            other = SimpleNamespace(**{**vars(swim), "model": swimmer(density, viscosity)})
            assert np.abs(found - in_c(other, 0, 1).qacc).max() > most


def test_a_swim_matches_c_mujoco(swim: SimpleNamespace):
    for lane in range(LANES):
        data = in_c(swim, lane, STEPS)
        close(swim.later.qpos[:, lane], data.qpos, 2e-3)
