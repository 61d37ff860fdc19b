"""Bodies of one topology that differ in every number, and their simulation in C MuJoCo."""

import copy
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mjxgait.physics.derived import ObservationLayout
from mjxgait.types import BodyState, Plant

XML = """
<mujoco>
  <option timestep="0.004" integrator="Euler" cone="pyramidal" solver="Newton" iterations="30" ls_iterations="20" tolerance="1e-12">
    <flag eulerdamp="disable"/>
  </option>
  <default>
    <geom contype="0" conaffinity="0"/>
    <joint armature="0.01" damping="0.1"/>
    <default class="foot"><geom mass="0.1" conaffinity="1"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" contype="1" friction="0.8" margin="0.002"/>
    <body name="trunk" pos="0 0 0.4">
      <freejoint/>
      <geom name="trunk" type="box" size="0.15 0.1 0.05" mass="3"/>
      <body name="thigh" pos="0.1 0.1 -0.03" quat="0.98 0.05 0.1 0.15">
        <joint name="roll" axis="1 0 0" range="-35 35" limited="true"/>
        <joint name="pitch" axis="0 1 0" pos="0.01 0 0.02" stiffness="3" springref="10" ref="5"/>
        <geom name="thigh" type="capsule" fromto="0 0 0 0.02 0 -0.2" size="0.03" mass="0.8"/>
        <body name="shin" pos="0.02 0 -0.2">
          <joint name="knee" axis="0.6 0.8 0" range="-60 70" limited="true" margin="0.02"/>
          <geom name="shin" type="ellipsoid" size="0.02 0.03 0.09" pos="0 0 -0.09" mass="0.3"/>
          <geom name="toe" class="foot" type="capsule" pos="0 0 -0.19" size="0.02 0.05" quat="0.74 0.62 0.17 0.2" solref="0.03 0.8"/>
        </body>
      </body>
      <body name="leg" pos="-0.1 -0.1 -0.03">
        <joint name="reach" type="slide" axis="0 0 1" stiffness="2000"/>
        <geom name="leg" type="cylinder" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.5"/>
        <geom name="heel" class="foot" type="sphere" pos="0 0 -0.32" size="0.03" friction="0.7"/>
      </body>
      <body name="tail" pos="-0.15 0 0.02">
        <joint name="tail" type="ball" pos="0.01 0 0" damping="0.02"/>
        <geom name="tail" type="capsule" fromto="0 0 0 -0.15 0 0.05" size="0.02" mass="0.3"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""
"""A body with every kind of joint and contact that the lane-major physics supports."""
WATCHED = ("toe", "heel", "trunk", "shin", "leg")
SLIM = {"xla_backend_optimization_level": 0}
"""Compilation takes most of the time here."""

Everything = tuple[Any, jax.Array, BodyState]


def heavier_model(model: mujoco.MjModel, factor: ArrayLike) -> mujoco.MjModel:
    """Return a copy with masses and inertias times factor, [] or [nbody - 1].

    MuJoCo recomputes what follows from them (`mj_setConst`).
    """
    heavy = copy.deepcopy(model)
    heavy.body_mass[1:] *= factor
    heavy.body_inertia[1:] = (heavy.body_inertia[1:].T * factor).T
    mujoco.mj_setConst(heavy, mujoco.MjData(heavy))
    return heavy


def varied(xml: str, seed: int, most: float = 0.25) -> mujoco.MjModel:
    """Change each length, mass, spring, range and material of the model independently.

    most: largest relative change. The model is compiled again, so inertias and all else follow.
    """
    spec, rng = mujoco.MjSpec.from_string(xml), np.random.default_rng(seed)

    def change(element: Any, *names: str) -> None:
        for name in names:
            old = getattr(element, name)
            factor = rng.uniform(1 - most, 1 + most, np.shape(old))
            setattr(element, name, old * factor)

    def soften(element: Any, name: str) -> None:
        old = getattr(element, name)
        setattr(element, name, old * [*rng.uniform(1 - most, 1, 4), 1.0])

    for body in spec.bodies[1:]:
        change(body, "pos", "quat")
    for joint in spec.joints:
        change(joint, "pos", "axis", "armature", "range", "ref", "margin")
        change(joint, "stiffness", "damping", "springref", "solref_limit")
        soften(joint, "solimp_limit")
    for geom in spec.geoms:
        if geom.name != "floor":
            change(geom, "fromto", "pos", "quat", "size", "mass", "density")
        change(geom, "friction", "margin", "solref")
        soften(geom, "solimp")
    change(spec.option, "gravity", "impratio")
    return spec.compile()


def layout_of(model: mujoco.MjModel, watched: Sequence[str] = WATCHED) -> ObservationLayout:
    """Layout in which all hinges are actuated."""
    hinges = np.nonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)[0]
    geoms = np.array([model.geom(name).id for name in watched])
    trunk = model.body("trunk").id
    return ObservationLayout(trunk, model.jnt_qposadr[hinges], model.jnt_dofadr[hinges], geoms)


@dataclasses.dataclass(frozen=True)
class Moment:
    """States, torques and damping [L, nv] of all bodies, in NumPy with lanes first."""

    state: BodyState
    torque: np.ndarray
    damping: np.ndarray

    def for_plant(self, plant: Plant, parameters: Any = None) -> tuple[BodyState, Any, Any]:
        """Move the lanes to the axis of the plant. parameters: leaves [L, ...]."""
        state = dataclasses.replace(self.state, parameters=parameters)
        rows = (state, self.torque, self.damping)
        return jax.tree.map(
            lambda x: jnp.moveaxis(jnp.asarray(x, jnp.float32), 0, plant.lane_axis), rows
        )

    def of(self, lane: int) -> "Moment":
        """Return one lane and keep its axis."""
        rows = (self.state, self.torque, self.damping)
        return Moment(*jax.tree.map(lambda x: x[lane : lane + 1], rows))


def moments(models: Sequence[mujoco.MjModel], seed: int = 1) -> Moment:
    """Random states, some of which touch the floor."""
    rng, model = np.random.default_rng(seed), models[0]
    count = len(models)
    qpos = np.stack([m.qpos0 for m in models]) + 0.2 * rng.normal(size=(count, model.nq))
    qpos[:, :3] = rng.normal(size=(count, 3)) * (2, 2, 0) + (0, 0, 0.3)
    qpos[:, 2] += np.linspace(-0.1, 0.3, count)
    for j in range(model.njnt):
        start = model.jnt_qposadr[j]
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE:
            qpos[:, start] *= 0.05
        if model.jnt_type[j] in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL):
            turn = qpos[:, start + 3 * (model.jnt_type[j] == 0) :][:, :4]
            turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    qvel, warm, torque = rng.normal(size=(3, count, model.nv))
    friction = rng.uniform(0.3, 1.5, count)
    damping = rng.uniform(0, 0.1, (count, model.nv))
    return Moment(BodyState(qpos, qvel, warm, 0 * warm, friction), 2 * torque, damping)


def everything(plant: Plant) -> Callable[..., Everything]:
    """Program from state, torque and damping to the results of all methods of the plant."""

    def program(state: BodyState, torque: jax.Array, damping: jax.Array) -> Everything:
        sensed, step_data = plant.forward(state)
        solved = plant.solve_damped(step_data, damping, torque)
        return sensed, solved, plant.advance(state, step_data, torque)

    return program


def compiled(function: Callable[..., Any], *arguments: Any) -> Any:
    """Compile a function as fast as possible."""
    return jax.jit(function).lower(*arguments).compile(compiler_options=SLIM)


def in_front(plant: Plant, results: Any) -> Any:
    """Results in NumPy with lanes first."""
    return jax.tree.map(lambda x: np.moveaxis(np.asarray(x), plant.lane_axis, 0), results)


def stacked(each: Sequence[Any]) -> Any:
    """Parameters of many bodies; leaves [L, ...]."""
    return jax.tree.map(lambda *leaves: np.stack(leaves), *each)


def one_in_c(model: mujoco.MjModel, moment: Moment, steps: int = 0) -> mujoco.MjData:
    """Simulate one lane in C MuJoCo for `steps`; 0 computes forward dynamics only."""
    data, state = mujoco.MjData(model), jax.tree.map(lambda x: np.float32(x)[0], moment.state)
    data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = state.qpos, state.qvel, state.warmstart
    data.qfrc_applied[:] = np.float32(moment.torque[0])
    nominal = model.geom_friction.copy()
    model.geom_friction[:, 0] *= state.friction
    if steps:
        mujoco.mj_step(model, data, steps)
    else:
        mujoco.mj_forward(model, data)
    model.geom_friction[:] = nominal
    return data
