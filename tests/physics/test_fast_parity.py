"""Lane-major physics against C MuJoCo (float64) and MJX, with all supported joints and contacts."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from mjxgait.physics.derived import ObservationLayout
from mjxgait.physics.lane_major import LaneMajorPlant, lane_major_plant
from mjxgait.physics.mjx import mjx_plant
from mjxgait.types import BodyState

LEG = """
<body name="{name}_hip" pos="{x} {y} -0.03" quat="0.98 0.05 0.1 0.15">
  <joint name="{name}_roll" axis="1 0 0" range="-35 35" limited="true" damping="0.2" armature="0.01"/>
  <joint name="{name}_pitch" axis="0 1 0" pos="0.01 0 0.02" stiffness="3" springref="10" armature="0.01" ref="5"/>
  <geom type="capsule" fromto="0 0 0 0.02 0 -0.2" size="0.03" mass="0.8" contype="0" conaffinity="0"/>
  <body name="{name}_shin" pos="0.02 0 -0.2">
    <joint name="{name}_knee" axis="0.6 0.8 0" range="-60 70" limited="true" margin="0.02" armature="0.02"/>
    <geom type="ellipsoid" size="0.02 0.03 0.09" pos="0 0 -0.09" mass="0.3" contype="0" conaffinity="0"/>
    <body name="{name}_toe" pos="0 0 -0.19">
      <joint name="{name}_toe" type="slide" axis="0 0 1" stiffness="2000" damping="10" armature="0.05"/>
      {foot}
    </body>
  </body>
</body>
"""
SPHERE = '<geom name="{name}_foot" class="foot" type="sphere" size="0.03" friction="0.7" solimp="0.9 0.95 0.01 0.4 3"/>'
CAPSULE = '<geom name="{name}_foot" class="foot" type="capsule" size="0.02 0.05" euler="80 0 30" solref="0.03 0.8"/>'


def _leg(name: str, x: float, y: float, foot: str) -> str:
    return LEG.format(name=name, x=x, y=y, foot=foot.format(name=name))


XML = f"""
<mujoco>
  <option timestep="0.004" integrator="Euler" cone="pyramidal" solver="Newton" iterations="30" ls_iterations="20" tolerance="1e-12">
    <flag eulerdamp="disable"/>
  </option>
  <default><default class="foot"><geom mass="0.1" contype="0" conaffinity="1"/></default></default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="0" friction="0.8" margin="0.002"/>
    <body name="trunk" pos="0 0 0.44">
      <freejoint/>
      <geom name="trunk" type="box" size="0.15 0.1 0.05" mass="5" contype="0" conaffinity="0"/>
      {_leg("left", 0.1, 0.12, SPHERE)}
      {_leg("right", 0.1, -0.12, CAPSULE)}
      {_leg("rear", -0.15, 0.0, SPHERE)}
      <body name="tail" pos="-0.15 0 0.02">
        <joint name="tail" type="ball" pos="0.01 0 0" damping="0.02" armature="0.005"/>
        <geom name="tail" type="cylinder" fromto="0 0 0 -0.15 0 0.05" size="0.02" mass="0.3" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""
WATCHED = ("left_foot", "right_foot", "rear_foot", "trunk", "tail")
LANES = 12
SLIM = {"xla_backend_optimization_level": 0}
"""Most of the time here is compilation."""


@dataclasses.dataclass
class Scene:
    model: mujoco.MjModel
    plant: LaneMajorPlant
    layout: ObservationLayout
    state: BodyState
    torque: np.ndarray
    damping: np.ndarray


def _states(model: mujoco.MjModel) -> BodyState:
    """Lanes in the air, standing, sliding, tumbling and beyond joint limits, far from the origin.

    Each lane has its own friction.
    """
    rng = np.random.default_rng(1)
    qpos = np.tile(model.qpos0[:, None], LANES)
    qpos[0] += 80.0
    qpos[2] += np.linspace(-0.07, 0.15, LANES)
    qpos[3:7] += 0.1 * rng.normal(size=(4, LANES))
    qpos[7:] += rng.uniform(-1.2, 1.2, (model.nq - 7, LANES)) * (np.arange(LANES) % 3 > 0)
    qpos[model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE]] *= 0.01
    for start in (3, model.jnt_qposadr[model.joint("tail").id]):
        qpos[start : start + 4] /= np.linalg.norm(qpos[start : start + 4], axis=0)
    qvel, warmstart = rng.normal(size=(2, model.nv, LANES))
    qvel[0] += 2.0
    arrays = (qpos, qvel, warmstart, np.zeros_like(qvel), rng.uniform(0.3, 1.5, LANES))
    return BodyState(*(jnp.asarray(a, jnp.float32) for a in arrays))


@pytest.fixture(scope="module")
def scene() -> Scene:
    model = mujoco.MjModel.from_xml_string(XML)
    hinges = np.nonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)[0]
    watched = np.array([model.geom(name).id for name in WATCHED])
    layout = ObservationLayout(
        model.body("trunk").id, model.jnt_qposadr[hinges], model.jnt_dofadr[hinges], watched
    )
    rng = np.random.default_rng(2)
    torque = np.asarray(2 * rng.normal(size=(model.nv, LANES)), np.float32)
    damping = np.asarray(rng.uniform(0, 0.1, (model.nv, LANES)), np.float32)
    return Scene(model, lane_major_plant(model, layout), layout, _states(model), torque, damping)


Everything = Callable[[BodyState, Any, Any], Any]


def _everything(plant: Any) -> Everything:
    """Function of state, damping and torque with the results of all three methods."""

    def everything(state: BodyState, damping: jax.Array, torque: jax.Array) -> Any:
        sensed, step_data = plant.forward(state)
        return (
            sensed,
            plant.solve_damped(step_data, damping, torque),
            plant.advance(state, step_data, torque),
        )

    return everything


@pytest.fixture(scope="module")
def step(scene: Scene) -> Everything:
    lowered = jax.jit(_everything(scene.plant)).lower(scene.state, scene.damping, scene.torque)
    return lowered.compile(compiler_options=SLIM)


@pytest.fixture(scope="module")
def result(scene: Scene, step: Everything) -> Any:
    """Sensed values, damped solution and next state, as NumPy arrays."""
    return jax.tree.map(np.asarray, step(scene.state, scene.damping, scene.torque))


@pytest.fixture(scope="module")
def references(scene: Scene) -> list[mujoco.MjData]:
    """C MuJoCo's forward dynamics of every lane."""
    return [_forward_in_c(scene, lane) for lane in range(LANES)]


def _forward_in_c(scene: Scene, lane: int, advance: bool = False) -> mujoco.MjData:
    model, data = scene.model, mujoco.MjData(scene.model)
    state = jax.tree.map(lambda x: np.asarray(x[..., lane], np.float64), scene.state)
    data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = state.qpos, state.qvel, state.warmstart
    data.qfrc_applied[:] = scene.torque[:, lane]
    nominal = model.geom_friction.copy()
    model.geom_friction[:, 0] *= state.friction
    (mujoco.mj_step if advance else mujoco.mj_forward)(model, data)
    model.geom_friction[:] = nominal
    return data


def _close(ours: np.ndarray, theirs: np.ndarray, tolerance: float = 1e-5) -> None:
    """Equal within a fraction of the largest entry."""
    np.testing.assert_allclose(
        ours, theirs, rtol=0, atol=tolerance * max(np.abs(theirs).max(), 1e-2)
    )


def test_states_cover_limits_and_contacts(scene: Scene, references: list[mujoco.MjData]) -> None:
    types = [set(np.asarray(data.efc_type[: data.nefc])) for data in references]
    limit, contact = (
        int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT),
        int(mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL),
    )
    assert set() in types
    assert any(limit in t for t in types)
    assert any(contact in t for t in types)
    assert max(data.ncon for data in references) >= 3


def test_sensed_values_match_c_mujoco(
    scene: Scene, result: Any, references: list[mujoco.MjData]
) -> None:
    sensed, layout = result[0], scene.layout
    for lane, data in enumerate(references):
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(
            scene.model, data, mujoco.mjtObj.mjOBJ_XBODY, layout.trunk, velocity, 0
        )
        _close(sensed.joint_pos[:, lane], data.qpos[layout.qpos_adr])
        _close(sensed.joint_vel[:, lane], data.qvel[layout.dof_adr])
        _close(sensed.bias[:, lane], data.qfrc_bias - data.qfrc_passive)
        _close(sensed.trunk_pos[:, lane], data.xpos[layout.trunk], 1e-6)
        _close(sensed.trunk_rot[..., lane], data.xmat[layout.trunk].reshape(3, 3), 1e-6)
        _close(sensed.trunk_vel[:, lane], velocity[3:])
        _close(sensed.trunk_angvel[:, lane], velocity[:3])
        _close(sensed.geom_pos[..., lane], data.geom_xpos[layout.watched], 1e-6)


def test_lowest_points_match_sampled_surfaces(
    scene: Scene, result: Any, references: list[mujoco.MjData]
) -> None:
    """Against the lowest of many points on each shape's surface."""
    rng = np.random.default_rng(3)
    unit = rng.normal(size=(20000, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    size = scene.model.geom_size
    left, right, rear, trunk, tail = scene.layout.watched
    end, disc = (
        np.sign(unit[:, 2:]) * [0, 0, 1],
        unit * [1, 1, 0] / np.linalg.norm(unit[:, :2], axis=1, keepdims=True),
    )
    surfaces = [
        size[left][0] * unit,
        size[right][0] * unit + size[right][1] * end,
        size[rear][0] * unit,
        size[trunk] * np.sign(unit),
    ]
    surfaces.append(size[tail][0] * disc + size[tail][1] * end)
    for lane, data in enumerate(references):
        for n, (geom, points) in enumerate(zip(scene.layout.watched, surfaces, strict=True)):
            lowest = (data.geom_xpos[geom] + points @ data.geom_xmat[geom].reshape(3, 3).T)[
                :, 2
            ].min()
            assert abs(result[0].geom_low[n, lane] - lowest) < 3e-4


def test_the_damped_solution_matches_c_mujoco(
    scene: Scene, result: Any, references: list[mujoco.MjData]
) -> None:
    for lane, data in enumerate(references):
        mass = np.zeros((scene.model.nv, scene.model.nv))
        mujoco.mj_fullM(scene.model, data, mass)
        _close(
            result[1][:, lane],
            np.linalg.solve(mass + np.diag(scene.damping[:, lane]), scene.torque[:, lane]),
        )


def test_acceleration_and_constraint_force_match_c_mujoco(
    result: Any, references: list[mujoco.MjData]
) -> None:
    for lane, data in enumerate(references):
        scale = np.abs(data.qacc).max()
        np.testing.assert_allclose(
            result[2].warmstart[:, lane], data.qacc, rtol=0, atol=2e-5 * scale
        )
        _close(result[2].constraint_force[:, lane], data.qfrc_constraint, 2e-4)


def test_one_step_matches_c_mujoco(scene: Scene, result: Any) -> None:
    for lane in range(LANES):
        data = _forward_in_c(scene, lane, advance=True)
        _close(result[2].qpos[:, lane], data.qpos, 1e-6)
        _close(result[2].qvel[:, lane], data.qvel)


@pytest.mark.thorough("test_ground_parity.py compares all that both plants give of another body")
def test_one_step_matches_mjx(scene: Scene, result: Any) -> None:
    """MJX computes in float32 too: wider tolerances."""
    in_front = jax.tree.map(
        lambda x: jnp.moveaxis(x, -1, 0), (scene.state, scene.damping, scene.torque)
    )
    program = jax.jit(_everything(mjx_plant(scene.model, scene.layout))).lower(*in_front)
    sensed, damped, after = program.compile(compiler_options=SLIM)(*in_front)
    for ours, theirs in zip(
        jax.tree.leaves(result), jax.tree.leaves((sensed, damped, after)), strict=True
    ):
        theirs = np.moveaxis(np.asarray(theirs), 0, -1)
        _close(ours, theirs, 1e-3)


def test_a_hundred_steps_match_c_mujoco(scene: Scene, step: Everything) -> None:
    """A drop on passive legs, through the impact, within float32 accuracy."""
    state, still = scene.state, jnp.zeros_like(scene.torque)
    data = [mujoco.MjData(scene.model) for _ in range(LANES)]
    nominal = scene.model.geom_friction.copy()
    for lane, d in enumerate(data):
        d.qpos[:], d.qvel[:] = np.asarray(state.qpos[:, lane]), np.asarray(state.qvel[:, lane])
        d.qacc_warmstart[:] = np.asarray(state.warmstart[:, lane])
    for _ in range(100):
        state = step(state, scene.damping, still)[2]
    for lane, d in enumerate(data):
        scene.model.geom_friction[:, 0] = nominal[:, 0] * float(state.friction[lane])
        mujoco.mj_step(scene.model, d, 100)
    scene.model.geom_friction[:] = nominal
    apart = [np.abs(np.asarray(state.qpos[:, lane]) - d.qpos).max() for lane, d in enumerate(data)]
    assert np.median(apart) < 2e-3
    assert max(apart) < 5e-2


def test_lanes_do_not_affect_each_other(scene: Scene, step: Everything, result: Any) -> None:
    """A lane's result is bit for bit the same next to any lanes, broken ones included."""
    broken = jax.tree.map(lambda x: x.at[..., ::2].set(jnp.nan), scene.state)
    among_broken = step(broken, scene.damping, scene.torque)
    for ours, theirs in zip(jax.tree.leaves(result), jax.tree.leaves(among_broken), strict=True):
        np.testing.assert_array_equal(ours[..., 1::2], np.asarray(theirs)[..., 1::2])
