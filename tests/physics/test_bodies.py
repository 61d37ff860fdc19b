"""One program with a different body in each lane, against each body alone and C MuJoCo."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from jax.tree_util import keystr
from many_bodies import (
    WATCHED,
    XML,
    Moment,
    compiled,
    everything,
    in_front,
    layout_of,
    moments,
    one_in_c,
    stacked,
    varied,
)

from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.physics.mjx import mjx_plant
from mjxgait.types import Plant

BODIES, STEPS = 6, 80
PLANTS = {"fast": lane_major_plant, "mjx": mjx_plant}
TIGHT = {"fast": 1.0, "mjx": 50.0}
"""Factor on the tolerances of lane-major physics: MJX loses more in single precision."""

BARS = {".bars.centre", ".bars.half", ".bars.radius", ".bars.reach"}
RARE = {"dof_frictionloss", "dof_solref", "dof_solimp", "geom_gap", "geom_solmix"}
DRY = {".density", ".viscosity"}
ALIKE = {"fast": BARS | DRY, "mjx": BARS | {f".model['{name}']" for name in RARE}}
"""Equal in all bodies: none is checked for overlap, has dry friction, or swims."""


@pytest.fixture(scope="module")
def models() -> list[mujoco.MjModel]:
    return [varied(XML, seed) for seed in range(BODIES)]


@pytest.fixture(scope="module")
def moment(models: list[mujoco.MjModel]) -> Moment:
    return moments(models)


MJX = pytest.mark.thorough("test_weights.py and test_body_parts.py have bodies per lane on MJX")


@pytest.fixture(scope="module", params=["fast", pytest.param("mjx", marks=MJX)])
def plant(request: pytest.FixtureRequest) -> Plant:
    """A plant made for a body that is in none of the lanes."""
    model = mujoco.MjModel.from_xml_string(XML)
    return PLANTS[request.param](model, layout_of(model))


ALONE = pytest.mark.thorough(
    "test_each_is_what_it_is_in_c compares the same bodies, and test_fast_parity.py constants"
)


@pytest.fixture(scope="module")
def tight(plant: Plant) -> float:
    return TIGHT["fast" if plant.lane_axis else "mjx"]


@pytest.fixture(scope="module")
def numbers(plant: Plant, models: list[mujoco.MjModel]) -> list[Any]:
    return [plant.parameters_of(model, layout_of(model)) for model in models]


@pytest.fixture(scope="module")
def batch(plant: Plant, numbers: list[Any], moment: Moment) -> Callable[..., Any]:
    """The program of all bodies in one batch."""
    return compiled(everything(plant), *moment.for_plant(plant, stacked(numbers)))


@pytest.fixture(scope="module")
def together(plant: Plant, numbers: list[Any], moment: Moment, batch: Callable[..., Any]) -> Any:
    """Results of all bodies in one batch; lanes first."""
    return in_front(plant, batch(*moment.for_plant(plant, stacked(numbers))))


def close(ours: Any, theirs: Any, tolerance: float) -> None:
    """Equal within a fraction of the largest entry."""
    most = tolerance * max(np.abs(theirs).max(initial=0), 1e-2)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=most)


def test_the_bodies_differ_in_every_parameter(numbers: list[Any], plant: Plant):
    found = jax.tree_util.tree_leaves_with_path(stacked(numbers))
    alike = {keystr(path) for path, x in found if np.ptp(x, axis=0).max(initial=0) == 0}
    assert alike == ALIKE["fast" if plant.lane_axis else "mjx"]


def test_some_bodies_touch_the_floor_and_some_do_not(models: list[mujoco.MjModel], moment: Moment):
    data = [one_in_c(model, moment.of(lane)) for lane, model in enumerate(models)]
    assert {0} < {d.ncon for d in data}


def test_each_is_what_it_is_in_c(
    models: list[mujoco.MjModel], moment: Moment, together: Any, tight: float
):
    sensed, solved, after = together
    for lane, model in enumerate(models):
        data, layout = one_in_c(model, moment.of(lane)), layout_of(model)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        damped = np.linalg.solve(mass + np.diag(moment.damping[lane]), moment.torque[lane])
        close(sensed.bias[lane], data.qfrc_bias - data.qfrc_passive, 1e-5 * tight)
        close(sensed.trunk_rot[lane], data.xmat[layout.trunk].reshape(3, 3), 1e-6 * tight)
        close(sensed.geom_pos[lane], data.geom_xpos[layout.watched], 1e-6 * tight)
        close(solved[lane], damped, 1e-5 * tight)
        close(after.warmstart[lane], data.qacc, 2e-5 * tight)
        close(after.constraint_force[lane], data.qfrc_constraint, 2e-4 * tight)


def test_lowest_points_match_c_mujoco(models: list[mujoco.MjModel], moment: Moment, together: Any):
    """Against MuJoCo's distance of spheres and capsules from a plane; see test_fast_parity."""
    for lane, model in enumerate(models):
        data = one_in_c(model, moment.of(lane))
        for n, name in enumerate(WATCHED[:2]):
            floor, geom = (model.geom(g).id for g in ("floor", name))
            low = mujoco.mj_geomDistance(model, data, floor, geom, 9.0, None)
            assert together[0].geom_low[lane, n] == pytest.approx(low, abs=1e-5)


@ALONE
def test_a_batch_matches_each_body_alone(
    plant: Plant, numbers: list[Any], moment: Moment, together: Any, tight: float
):
    """One body in all lanes, its parameters as inputs of one program."""

    def alone(parameters: Any, *arguments: Any) -> Any:
        return everything(plant.with_parameters(parameters))(*arguments)

    inputs = [jax.tree.map(jnp.float32, each) for each in numbers]
    rows = [moment.of(lane).for_plant(plant) for lane in range(BODIES)]
    program = compiled(alone, inputs[0], *rows[0])
    for lane, (parameters, row) in enumerate(zip(inputs, rows, strict=True)):
        theirs = in_front(plant, program(parameters, *row))
        ours = dataclasses.replace(together[2], parameters=None)
        for a, b in zip(
            jax.tree.leaves((*together[:2], ours)), jax.tree.leaves(theirs), strict=True
        ):
            close(a[lane], b[0], 2e-5 * tight)


def test_eighty_steps_match_c_mujoco(
    plant: Plant, models: list[mujoco.MjModel], numbers: list[Any], batch: Callable[..., Any]
):
    """Through impacts, different for each body; within float32 accuracy."""
    moment = moments(models, seed=2)
    moment = dataclasses.replace(moment, torque=0.1 * moment.torque)
    state, torque, damping = moment.for_plant(plant, stacked(numbers))
    for _ in range(STEPS):
        state = batch(state, torque, damping)[2]
    theirs = [one_in_c(model, moment.of(lane), STEPS).qpos for lane, model in enumerate(models)]
    apart = np.abs(in_front(plant, state.qpos) - theirs).max(axis=1)
    assert np.median(apart) < 2e-3
    assert apart.max() < 5e-2


def test_a_lane_keeps_its_body(plant: Plant, numbers: list[Any], together: Any):
    after, before = together[2].parameters, stacked(numbers)
    for a, b in zip(jax.tree.leaves(after), jax.tree.leaves(before), strict=True):
        np.testing.assert_array_equal(a, np.float32(b))


@ALONE
def test_without_parameters_the_plants_own_body_is_used(
    plant: Plant, moment: Moment, batch: Callable[..., Any], tight: float
):
    """The same numbers as constants and as inputs give the same result."""
    own = stacked([plant.parameters] * BODIES)
    given, none = moment.for_plant(plant, own), moment.for_plant(plant)
    ours = compiled(everything(plant), *none)(*none)
    theirs = batch(*given)
    assert ours[2].parameters is None
    theirs = (*theirs[:2], dataclasses.replace(theirs[2], parameters=None))
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        close(np.asarray(a), np.asarray(b), 2e-5 * tight)


@pytest.mark.thorough("tests/training/test_inputs.py compares the programs of whole runs")
def test_parameters_as_inputs_share_one_program(plant: Plant, numbers: list[Any], moment: Moment):
    def text(parameters: Any) -> str:
        def program(parameters: Any, *arguments: Any) -> Any:
            return everything(plant.with_parameters(parameters))(*arguments)

        inputs = jax.tree.map(jnp.float32, parameters)
        return jax.jit(program).lower(inputs, *moment.of(0).for_plant(plant)).as_text()

    assert text(numbers[0]) == text(numbers[1])


def test_parameters_as_constants_make_separate_programs(
    plant: Plant, numbers: list[Any], moment: Moment
):
    def text(parameters: Any) -> str:
        other = plant.with_parameters(parameters)
        state = moment.of(0).for_plant(plant)[0]
        return jax.jit(lambda state: other.forward(state)[0]).lower(state).as_text()

    assert text(numbers[0]) != text(numbers[1])
