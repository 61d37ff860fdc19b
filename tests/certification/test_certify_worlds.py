"""Floors as steep and slippery as set, with nothing else changed."""

import numpy as np
import pytest
from certify_made_up import make_champion

from mjxgait.certification.stress import slippery, sloping
from mjxgait.certification.trials import simulate
from mjxgait.reference.outcome import Fall
from mjxgait.reference.starts import perturbed_starts


def rng(seed=0):
    return np.random.default_rng(seed)


@pytest.mark.parametrize(
    "world",
    [
        lambda c: sloping(c, 0.1),
        lambda c: slippery(c, 0.4),
    ],
)
def test_another_floor_does_not_change_the_body(tiny, world):
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


def test_a_slope_pulls_back_by_its_sine(tiny):
    uphill = sloping(tiny, np.radians(30.0)).model.opt.gravity
    assert uphill == pytest.approx([-9.81 / 2, 0, -9.81 * np.sqrt(3) / 2])
    assert sloping(tiny, np.radians(-30.0)).model.opt.gravity[0] == pytest.approx(9.81 / 2)


def test_a_standing_body_slides_if_friction_is_below_the_slope(tiny):
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
