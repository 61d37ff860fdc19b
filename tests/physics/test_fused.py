"""Fixed bodies merge into their parents in lane-major physics without changing the motion."""

from typing import Any

import jax
import mujoco
import numpy as np
import pytest
from jax.tree_util import keystr
from many_bodies import (
    XML,
    compiled,
    everything,
    heavier_model,
    in_front,
    layout_of,
    moments,
    one_in_c,
    stacked,
    varied,
)

from mjxgait.creature.overlap import Crossings, bar_places, pair_depths
from mjxgait.physics.lane_major import LaneMajorPlant, lane_major_plant

TOE = '<geom name="toe" class="foot"'
WELDED = (
    XML.replace(
        TOE,
        f"""<body name="ankle" pos="0.01 0.02 -0.02" quat="0.9 0.1 0.2 0.3">
          <geom type="box" size="0.02 0.03 0.01" mass="0.2"/>
          <body name="paw" pos="0.01 0 0.01" quat="0.8 -0.3 0.1 0.2">
            {TOE}""",
    )
    .replace(
        'solref="0.03 0.8"/>',
        """solref="0.03 0.8"/></body></body>""",
    )
    .replace(
        '<body name="thigh"',
        """<body name="rotor" pos="0.05 -0.1 0.06" quat="0.7 0.1 0.6 0.2">
        <geom type="cylinder" size="0.03 0.02" mass="0.7"/>
        <body name="imu" pos="0 0 0.1"/>
      </body>
      <body name="thigh\"""",
    )
)
"""The body of many_bodies with a paw on an ankle on the shin, a rotor and a sensor on the trunk."""
MODELS = [varied(WELDED, seed) for seed in range(4)]


@pytest.fixture(scope="module")
def plant() -> LaneMajorPlant:
    return lane_major_plant(MODELS[0], layout_of(MODELS[0]))


def close(ours: Any, theirs: Any, tolerance: float) -> None:
    """Equal within a fraction of the largest entry."""
    most = tolerance * max(np.abs(theirs).max(initial=0), 1e-2)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=most)


def test_only_bodies_with_joints_remain(plant: LaneMajorPlant):
    assert len(plant.topology.bodies) == MODELS[0].nbody - 1 - 4
    assert plant.topology.names == ("trunk", "thigh", "shin", "leg", "tail")


def test_a_model_without_fixed_bodies_is_unchanged():
    model = mujoco.MjModel.from_xml_string(XML)
    assert not lane_major_plant(model, layout_of(model)).topology.welded


def test_merged_bodies_move_as_in_c_mujoco(plant: LaneMajorPlant):
    """Four bodies that differ in every number, in lanes of one program."""
    moment = moments(MODELS)
    numbers = stacked([plant.parameters_of(model, layout_of(model)) for model in MODELS])
    arguments = moment.for_plant(plant, numbers)
    sensed, solved, after = in_front(plant, compiled(everything(plant), *arguments)(*arguments))
    touching = 0
    for lane, model in enumerate(MODELS):
        data, layout = one_in_c(model, moment.of(lane)), layout_of(model)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        damped = np.linalg.solve(mass + np.diag(moment.damping[lane]), moment.torque[lane])
        close(sensed.bias[lane], data.qfrc_bias - data.qfrc_passive, 1e-5)
        close(sensed.geom_pos[lane], data.geom_xpos[layout.watched], 1e-6)
        close(solved[lane], damped, 1e-5)
        close(after.warmstart[lane], data.qacc, 2e-5)
        close(after.constraint_force[lane], data.qfrc_constraint, 2e-4)
        touching += data.ncon
    assert touching


def test_mass_scales_include_merged_bodies(plant: LaneMajorPlant):
    """The weight of a contact on a merged body matches MuJoCo within 1 %."""
    model, factor = MODELS[1], np.linspace(0.6, 1.6, MODELS[1].nbody - 1)
    factor = factor[model.body_weldid[1:] - 1]
    ours = jax.jit(plant.with_mass_scale)(
        plant.parameters_of(model, layout_of(model)), np.float32(factor)
    )
    theirs = plant.parameters_of(heavier_model(model, factor), layout_of(model))
    for (path, a), b in zip(
        jax.tree_util.tree_leaves_with_path(ours), jax.tree.leaves(theirs), strict=True
    ):
        loose = 1e-2 if keystr(path) == ".contacts.weight" else 2e-5
        most = loose * np.abs(b).max(initial=1e-9)
        np.testing.assert_allclose(a, b, rtol=0, atol=most, err_msg=keystr(path))


def test_bars_on_merged_bodies_keep_their_places():
    """Overlaps match those of the unmerged MuJoCo model."""
    model = MODELS[0]
    ids = [model.body(name).id for name in ("paw", "rotor", "leg")]
    none = np.zeros(2)
    rng = np.random.default_rng(0)
    crossings = Crossings(
        body=np.array(ids),
        centre=rng.normal(size=(3, 3)) * 0.05,
        half=rng.normal(size=(3, 3)) * 0.05,
        radius=np.full(3, 0.1),
        first=np.array([0, 1]),
        second=np.array([1, 2]),
        allowed=none,
    )
    moment, plant = moments(MODELS), lane_major_plant(model, layout_of(model), crossings)
    ours = np.asarray(jax.jit(plant.overlap)(moment.for_plant(plant)[0]))
    poses = np.float32(moment.state.qpos)
    theirs = [pair_depths(crossings, *bar_places(model, qpos, crossings)).max() for qpos in poses]
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
    assert np.ptp(ours) > 1e-3
