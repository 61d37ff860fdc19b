"""Reference simulator on uneven ground: simulation, heights and measurements."""

import mujoco
import numpy as np
import pytest
from certify_made_up import make_champion

from mjxgait.certification.certificate import record
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.stress import slippery
from mjxgait.certification.trials import simulate
from mjxgait.reference.layout import LowestPoint
from mjxgait.reference.measure import measure
from mjxgait.reference.starts import nominal_starts
from mjxgait.reference.stepping import examined_model
from mjxgait.reference.terrain import grounded_model, terrain_of

ROUGH = "rough:0.1@2"


@pytest.fixture(scope="module")
def rough(tiny):
    return tiny.on(ROUGH)


def seen_from_above(model, x, y):
    """Height in m at which a ray straight down meets the ground."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    above, down = np.array([x, y, 50.0]), np.array([0, 0, -1.0])
    moving = np.zeros(1, np.int32)
    return 50.0 - mujoco.mj_ray(model, data, above, down, None, True, 1, moving, None)


@pytest.mark.parametrize(
    "text", ["slope:0.2:across", "slope:0.1", "steps:0.1@3", "bumps:0.1", ROUGH]
)
def test_the_height_field_matches_the_ground(tiny, text):
    model, terrain = grounded_model(tiny.on(text)), terrain_of(tiny.on(text))
    places = np.random.default_rng(0).uniform(-6, 6, (60, 2)) * tiny.frame.body_length
    places[:, 0] += 10 * tiny.frame.body_length
    found = [seen_from_above(model, *place) for place in places]
    wrong = np.abs(found - terrain.height(*places.T)) / tiny.frame.hip_height
    assert np.median(wrong) < 1e-3
    # The edge of a step is no wider than three cells.
    assert wrong.max() < (0.02 if "steps" in text else 2e-3)
    assert np.ptp(found) > 0.05 * tiny.frame.hip_height


def test_the_ground_does_not_change_the_body(tiny, rough):
    model = grounded_model(slippery(rough, 0.3))
    for field in ("body_mass", "geom_bodyid", "geom_solref", "jnt_range", "dof_armature"):
        np.testing.assert_array_equal(getattr(model, field), getattr(tiny.model, field))
    assert (model.geom_friction[:, 0] == 0.3).all()
    assert grounded_model(tiny) is tiny.model


def test_heights_are_measured_above_the_ground(rough):
    """Spheres on the ground have height zero there, but not above the plane."""
    terrain, model = terrain_of(rough), examined_model(rough)
    feet = rough.feet.watched[: len(rough.feet.foot_of)]
    size = model.geom_size[feet, 0]
    places = np.random.default_rng(1).uniform(3, 9, (30, len(feet), 2)) * rough.frame.body_length
    xpos, xmat = np.zeros((30, model.ngeom, 3)), np.tile(np.eye(3).ravel(), (30, model.ngeom, 1))
    steep = np.linalg.norm(terrain.steepness(*np.moveaxis(places, 2, 0)), axis=0)
    up = size * np.sqrt(1 + steep**2)
    xpos[:, feet] = np.dstack([places, terrain.height(*np.moveaxis(places, 2, 0)) + up])
    heights = LowestPoint(model, feet, terrain).heights(xpos, xmat)
    np.testing.assert_allclose(heights, 0.0, atol=1e-5)
    assert np.ptp(LowestPoint(model, feet).heights(xpos, xmat)) > 0.01


def test_a_body_stands_at_the_start_as_on_a_plane(tiny):
    """The ground is level at the start, and the field carries a body as the plane does."""
    up = tiny.on("slope:0.1")
    walk = record(up, make_champion(up), 1.0)
    level = record(tiny, make_champion(tiny), 1.0)
    np.testing.assert_allclose(walk.trunk_pos, level.trunk_pos, atol=2e-3)


def test_a_walk_uphill_is_measured_above_the_ground(tiny, trotter):
    """The trunk rises with the ground, but its measured height does not."""
    up = tiny.on("slope:0.05")
    outcome = simulate(up, trotter, nominal_starts(up, 1), 8.0, record=1)
    assert outcome.stayed_up.all()
    risen, whole = outcome.trajectory.qpos[0, :, 2], measure(up, outcome.trajectory)
    assert risen[-100:].mean() - risen[:100].mean() > 0.1 * tiny.frame.hip_height
    assert np.ptp(whole.trunk_pos[:, 2]) < 0.3 * tiny.frame.hip_height
    assert whole.contact.mean() > 0.2
    assert (
        np.nanmax(whole.penetration)
        < CertificateConfig().physics.penetration * tiny.frame.hip_height
    )
    carrying = whole.foot_height[whole.contact]
    assert np.abs(carrying).max() < 0.02 * tiny.frame.hip_height
    assert whole.touch.mean() == 0.0


def test_rough_ground_disturbs_and_differs_by_seed(tiny, trotter, rough):
    ways = [
        simulate(creature, trotter, nominal_starts(creature, 1), 4.0).travel[0]
        for creature in (tiny, rough, tiny.on("rough:0.1@3"))
    ]
    assert not np.allclose(ways[0], ways[1], atol=0.01)
    assert not np.allclose(ways[1], ways[2], atol=0.01)
