"""Both plants on uneven ground against C MuJoCo (float64), with one plane under each foot.

Gravity is tilted, too. Each plane touches the ground at the point nearest to the foot, from the
reference simulator's heights. So contacts in C have the same place, axes and weight, and whole
steps can be compared.
"""

import dataclasses
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from physics.test_fast_parity import LANES, SLIM, _everything, _states

from mjxgait.creature.ground.spec import Place, parse_ground
from mjxgait.creature.ground.surface import lay_ground, named_draws
from mjxgait.physics.derived import ObservationLayout
from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.physics.mjx import mjx_plant
from mjxgait.reference.layout import StartFrame
from mjxgait.reference.terrain import Terrain
from mjxgait.types import BodyState

HIP, LENGTH = 0.4, 0.5
FORWARD = np.array([0.6, 0.8, 0.0])
DOWN = np.array([-0.12, 0.16, -0.97980])
"""Direction of gravity."""
FEET = ("left_foot", "right_foot", "rear_foot")
LEG = """
<body name="{name}" pos="{place} -0.03" quat="0.98 0.05 0.1 0.15">
  <joint axis="{axis}" damping="0.2" armature="0.03"/>
  <geom class="bare" type="capsule" fromto="0 0 0 0.02 0 -0.3" size="0.03" mass="0.8"/>
  <geom name="{name}_foot" class="foot" type="sphere" pos="0.02 0 -0.39" size="0.03" {touch}/>
</body>"""
LEGS = (
    ("left", "0.1 0.12", "1 0 0", 'friction="0.7" solimp="0.9 0.95 0.01 0.4 3"'),
    ("right", "0.1 -0.12", "0 1 0", 'solref="0.03 0.8"'),
    ("rear", "-0.15 0", "0.6 0.8 0", ""),
)
FLOOR = (
    '<geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="0" friction="0.8" '
    'margin="0.002"/>'
)
BALLS = f"""
<mujoco>
  <option timestep="0.004" integrator="Euler" cone="pyramidal" solver="Newton" iterations="30"
    ls_iterations="20" tolerance="1e-12"><flag eulerdamp="disable"/></option>
  <default>
    <default class="bare"><geom contype="0" conaffinity="0"/></default>
    <default class="foot"><geom contype="0" conaffinity="1" mass="0.1"/></default>
  </default>
  <worldbody>
    {FLOOR}
    <body name="trunk" pos="0 0 0.44">
      <freejoint/>
      <geom class="bare" name="trunk" type="box" size="0.15 0.1 0.05" mass="5"/>
      {"".join(LEG.format(name=n, place=p, axis=a, touch=t) for n, p, a, t in LEGS)}
      <body name="tail" pos="-0.15 0 0.02">
        <joint name="tail" type="ball" pos="0.01 0 0" damping="0.02" armature="0.03"/>
        <geom class="bare" name="tail" type="sphere" pos="-0.1 0 0.03" size="0.04" mass="0.3"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""
"""A small body; what differs from test_fast_parity.py is the ground."""
EXACT = {"slope:0.3:across": 1e-5, "rough:0.3@1": 1e-3}
"""Tolerance for accelerations of one step, relative to the largest. On rough ground the plants
search the nearest point in two iterations; a plane needs one.
"""


def own_planes() -> str:
    """The same body; each foot collides only with its own movable plane."""

    def plane(n: int) -> str:
        geom = FLOOR.replace("floor", f"plane_{n}").replace('contype="1"', f'contype="{2**n}"')
        return f'<body name="under_{n}" mocap="true">{geom}</body>'

    xml = BALLS.replace(FLOOR, "".join(map(plane, range(len(FEET)))))
    for n, foot in enumerate(FEET):
        xml = xml.replace(f'name="{foot}"', f'name="{foot}" conaffinity="{2**n}"')
    return xml


@dataclasses.dataclass
class Scene:
    exact: float
    terrain: Terrain
    state: BodyState
    torque: np.ndarray
    fast: Any
    plain: Any
    in_c: list[mujoco.MjData]


@pytest.fixture(scope="module")
def plants() -> SimpleNamespace:
    """Both plants of the body on a floor, and the C model with planes; compiled once per kind."""
    model = mujoco.MjModel.from_xml_string(BALLS)
    hinges = np.nonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)[0]
    watched = np.array([model.geom(name).id for name in (*FEET, "trunk", "tail")])
    layout = ObservationLayout(
        model.body("trunk").id, model.jnt_qposadr[hinges], model.jnt_dofadr[hinges], watched
    )
    return SimpleNamespace(
        fast=lane_major_plant(model, layout),
        plain=mjx_plant(model, layout),
        planes=mujoco.MjModel.from_xml_string(own_planes()),
        plane_model=model,
        layout=layout,
    )


MORE = pytest.mark.thorough("another ground")


@pytest.fixture(
    scope="module", params=["rough:0.3@1", pytest.param("slope:0.3:across", marks=MORE)]
)
def scene(request: pytest.FixtureRequest, plants: SimpleNamespace) -> Scene:
    spec = parse_ground(request.param)
    start = np.zeros(3)
    ground = lay_ground(spec, Place(start, FORWARD, HIP, LENGTH), named_draws(spec.seed))
    ground = dataclasses.replace(ground, down=jnp.float32(DOWN))
    left = np.array([-FORWARD[1], FORWARD[0], 0.0])
    terrain = Terrain(spec, StartFrame(start, FORWARD, left), HIP, LENGTH)
    state = _states(plants.plane_model)
    # Near enough that float32 keeps the digits of the height.
    qpos = np.array(state.qpos)
    qpos[0] -= 70.0
    qpos[2] += terrain.height(qpos[0], qpos[1])
    every = jax.tree.map(lambda leaf: jnp.tile(leaf[..., None], LANES), ground)
    state = dataclasses.replace(state, qpos=jnp.asarray(qpos), ground=every)
    rng = np.random.default_rng(2)
    torque = np.asarray(2 * rng.normal(size=(plants.planes.nv, LANES)), np.float32)
    damping = np.asarray(rng.uniform(0, 0.1, torque.shape), np.float32)
    given = (state, damping, torque)
    fast = jax.jit(_everything(plants.fast)).lower(*given).compile(compiler_options=SLIM)
    in_front = jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), given)
    plain = jax.jit(_everything(plants.plain)).lower(*in_front).compile(compiler_options=SLIM)
    return Scene(
        EXACT[request.param],
        terrain,
        state,
        torque,
        jax.tree.map(np.asarray, fast(*given)),
        jax.tree.map(lambda x: np.moveaxis(np.asarray(x), 0, -1), plain(*in_front)),
        [step_in_c(plants.planes, terrain, state, torque, lane) for lane in range(LANES)],
    )


def step_in_c(
    model: mujoco.MjModel, terrain: Terrain, state: BodyState, torque: np.ndarray, lane: int
) -> mujoco.MjData:
    data, nominal = mujoco.MjData(model), model.geom_friction.copy()
    data.qpos[:], data.qvel[:] = np.asarray(state.qpos)[:, lane], np.asarray(state.qvel)[:, lane]
    data.qacc_warmstart[:] = np.asarray(state.warmstart)[:, lane]
    data.qfrc_applied[:] = torque[:, lane]
    mujoco.mj_kinematics(model, data)
    for n, foot in enumerate(FEET):
        place, normal = nearest(terrain, data.geom(foot).xpos)
        data.mocap_pos[n] = place
        mujoco.mju_quatZ2Vec(data.mocap_quat[n], normal)
    model.geom_friction[:, 0] *= float(state.friction[lane])
    model.opt.gravity[:] = 9.81 * DOWN
    mujoco.mj_step(model, data)
    model.geom_friction[:] = nominal
    return data


def nearest(terrain: Terrain, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point of the ground nearest to a centre, and the normal there."""
    x, y = centre[:2]
    for _ in range(50):
        below, steep = terrain.height(x, y), terrain.steepness(x, y)
        normal = np.append(-steep, 1.0) / np.sqrt(1 + (steep**2).sum())
        apart = (centre - [x, y, below]) @ normal
        x, y, _ = centre - apart * normal
    return np.array([x, y, terrain.height(x, y)]), normal


def apart(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest difference over the largest entry."""
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1e-2))


def test_some_feet_touch_the_ground_and_some_do_not(scene: Scene):
    touching = [data.ncon for data in scene.in_c]
    assert 0 in touching
    assert max(touching) >= 2


@pytest.mark.parametrize("plant", ["fast", "plain"])
def test_one_step_matches_c_mujoco(scene: Scene, plant: str):
    *_, after = getattr(scene, plant)
    for lane, data in enumerate(scene.in_c):
        assert apart(after.warmstart[:, lane], data.qacc) < scene.exact
        assert apart(after.qvel[:, lane], data.qvel) < scene.exact
        assert apart(after.qpos[:, lane], data.qpos) < 1e-6


def test_both_plants_agree(scene: Scene):
    """In sensed values, damped solution and next state; MJX computes in float32 too."""
    for ours, theirs in zip(*map(jax.tree.leaves, (scene.fast, scene.plain)), strict=True):
        assert apart(ours, theirs) < 1e-3


@pytest.mark.parametrize("plant", ["fast", "plain"])
def test_heights_are_measured_above_the_ground(scene: Scene, plant: str):
    """A sphere's lowest point from the nearest ground point; the trunk's height straight down."""
    sensed, *_ = getattr(scene, plant)
    for lane in range(LANES):
        x, y, _ = sensed.trunk_pos[:, lane]
        assert sensed.floor[lane] == pytest.approx(scene.terrain.height(x, y), abs=1e-4)
        for foot in range(len(FEET)):
            centre = sensed.geom_pos[foot, :, lane].astype(float)
            point, normal = nearest(scene.terrain, centre)
            height = (centre - point) @ normal - 0.03
            if height < 0.1:
                assert sensed.geom_low[foot, lane] == pytest.approx(height, abs=2e-3)
