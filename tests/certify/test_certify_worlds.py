"""Other ground: as high, as steep and as slippery as asked, and nothing else changed."""

import mujoco
import numpy as np
import pytest
from certify_made_up import make_champion

from mjxgait.certify.simulate import Fall, simulate
from mjxgait.certify.starts import nominal_starts, perturbed_starts
from mjxgait.certify.worlds import slippery, sloping, uneven

AMPLITUDE = 0.02


def rng(seed=0):
    return np.random.default_rng(seed)


def ground_height(creature, x, y):
    """m, where a ray from above meets the floor."""
    data = mujoco.MjData(creature.model)
    mujoco.mj_forward(creature.model, data)
    return 5.0 - mujoco.mj_ray(
        creature.model,
        data,
        np.array([x, y, 5.0]),
        np.array([0, 0, -1.0]),
        None,
        True,
        1,
        np.zeros(1, np.int32),
        None,
    )


@pytest.fixture(scope="module")
def rough(tiny):
    return uneven(tiny, AMPLITUDE, rng(), reach=6.0)


@pytest.mark.parametrize(
    "world",
    [
        lambda c: uneven(c, AMPLITUDE, rng(), reach=6.0),
        lambda c: sloping(c, 0.1),
        lambda c: slippery(c, 0.4),
    ],
)
def test_the_body_stays_what_it_is(tiny, world):
    before, after = tiny.model.geom_friction.copy(), world(tiny).model
    for field in (
        "body_mass",
        "body_inertia",
        "geom_bodyid",
        "geom_size",
        "geom_solref",
        "geom_priority",
        "jnt_range",
        "dof_armature",
    ):
        moving = slice(1, None) if field == "geom_size" else slice(None)
        np.testing.assert_array_equal(
            getattr(after, field)[moving], getattr(tiny.model, field)[moving]
        )
    assert [after.geom(i).name for i in range(after.ngeom)] == [
        tiny.model.geom(i).name for i in range(after.ngeom)
    ]
    np.testing.assert_array_equal(tiny.model.geom_friction, before)


def test_bumps_have_the_height_asked_for_and_the_start_is_level(tiny, rough):
    far = [ground_height(rough, x, y) for x in np.linspace(-5, 5, 40) for y in (-3.0, 1.9, 4.1)]
    assert np.abs(far).max() < AMPLITUDE + 1e-6
    assert np.abs(far).max() > 0.7 * AMPLITUDE
    assert abs(np.mean(far)) < 0.2 * AMPLITUDE
    near = [
        ground_height(rough, *(0.7 * tiny.body_length * np.array([np.cos(a), np.sin(a)])))
        for a in np.linspace(0, 6, 9)
    ]
    assert near == pytest.approx([0.0] * 9, abs=1e-6)


def test_floors_differ_and_the_same_seed_gives_the_same_floor(tiny, rough):
    np.testing.assert_array_equal(
        uneven(tiny, AMPLITUDE, rng(), reach=6.0).model.hfield_data, rough.model.hfield_data
    )
    assert not np.array_equal(
        uneven(tiny, AMPLITUDE, rng(1), reach=6.0).model.hfield_data, rough.model.hfield_data
    )


def test_without_height_it_is_the_plain_floor(tiny, trotter):
    level = uneven(tiny, 1e-9, rng(), reach=6.0)
    starts = nominal_starts(tiny, 1)
    on_plane, on_field = (
        simulate(c, trotter, starts, 1.0, fall=Fall(touch=False)).travel[0] for c in (tiny, level)
    )
    assert on_field == pytest.approx(on_plane, abs=0.02)


def test_bumps_disturb_the_walk(tiny, trotter, rough):
    starts = nominal_starts(tiny, 1)
    ways = [
        simulate(c, trotter, starts, 3.0, fall=Fall(touch=False)).travel[0] for c in (tiny, rough)
    ]
    assert not np.allclose(*ways, atol=0.02)


def test_a_slope_pulls_back_by_its_sine(tiny):
    uphill = sloping(tiny, np.radians(30.0)).model.opt.gravity
    assert uphill == pytest.approx([-9.81 / 2, 0, -9.81 * np.sqrt(3) / 2])
    assert sloping(tiny, np.radians(-30.0)).model.opt.gravity[0] == pytest.approx(9.81 / 2)


def test_what_stands_slides_where_the_slope_is_steeper_than_friction_holds(tiny):
    slope, starts = (
        sloping(tiny, np.arctan(0.25)),
        perturbed_starts(tiny, 2, rng(), friction=(1.0, 1.0)),
    )
    held, slid = (
        simulate(
            slippery(slope, friction),
            make_champion(tiny),
            starts,
            1.5,
            fall=Fall(min_up=-1, height=(0, 5), touch=False),
        ).travel[:, 0]
        for friction in (0.6, 0.1)
    )
    assert (slid < held - 0.3).all()
