"""Overlays: the goal on the floor and the bar are drawn, and change nothing else."""

import dataclasses

import mujoco
import numpy as np
import pytest
from rendering.made_up import treading

from mjxgait.creature import Creature
from mjxgait.rendering.gl import scene_file
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import Walk, record_walk


@pytest.fixture(scope="module")
def limbo(stool: Creature) -> Walk:
    return record_walk(stool, dataclasses.replace(treading(stool), task="limbo"), 0.5)


def marks(walk: Walk) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Place and size of each overlay, by kind."""
    model, data = walk.shown, mujoco.MjData(walk.shown)
    mujoco.mj_kinematics(model, data)
    extra = range(walk.creature.model.ngeom, model.ngeom)
    kinds = [mujoco.mjtGeom(model.geom_type[g]).name for g in extra]
    return {
        kind: (data.geom_xpos[g], model.geom_size[g])
        for kind, g in reversed(list(zip(kinds, extra, strict=True)))
    }


def test_a_walk_has_no_overlays(stool_walk: Walk):
    assert stool_walk.marked is None
    assert stool_walk.shown is stool_walk.creature.model


def test_the_goal_of_hopping_is_a_disc_on_the_floor(stool: Creature):
    walk = record_walk(stool, dataclasses.replace(treading(stool), task="hop"), 0.5)
    ((place, size),) = marks(walk).values()
    ahead = (place[:2] - stool.frame.stand_pos[:2]) @ walk.forward
    assert (ahead, place[2]) == (pytest.approx(1.2), size[1])


def test_the_bar_is_where_the_reference_simulator_has_it(limbo: Walk):
    place, size = marks(limbo)["mjGEOM_CAPSULE"]
    ahead = (place[:2] - limbo.creature.frame.stand_pos[:2]) @ limbo.forward
    assert (ahead, place[2] - size[0]) == (pytest.approx(0.6), pytest.approx(0.35))
    assert {"mjGEOM_CYLINDER", "mjGEOM_CAPSULE"} == set(marks(limbo))


def test_overlays_do_not_change_the_drawing_of_the_creature(limbo: Walk, stool_walk: Walk):
    """Scale and view depend on the creature alone, and its geoms come first."""
    with_bar, without = Stage([limbo], 320, 180), Stage([stool_walk], 320, 180)
    assert with_bar.scale == without.scale
    (barred,), (plain,) = with_bar.participants, without.participants
    count = len(plain.painter.far)
    np.testing.assert_array_equal(barred.painter.far[:count], plain.painter.far)
    for mine, plain in zip(
        limbo.geom_poses(np.array([3])), stool_walk.geom_poses(np.array([3])), strict=True
    ):
        np.testing.assert_allclose(mine[:, : plain.shape[1]], plain, atol=1e-9)


def test_the_gl_renderer_gets_the_overlays(limbo: Walk, tmp_path):
    scene_file(Stage([limbo], 320, 180), [0], tmp_path / "scene.npz")
    with np.load(tmp_path / "scene.npz") as scene:
        model = mujoco.MjModel.from_xml_string(str(scene["xml"]))
    assert model.ngeom == limbo.shown.ngeom
