"""Floors as steep and slippery as set, with nothing else changed."""

import dataclasses

import numpy as np
import pytest
from certify_made_up import make_champion

from mjxgait.certification.stress import slippery
from mjxgait.certification.trials import simulate
from mjxgait.creature import Creature
from mjxgait.reference.outcome import Fall
from mjxgait.reference.starts import Starts, batch_of, nominal_starts


def uphill(creature: Creature, *angles: float) -> Starts:
    """One start for each angle in rad at which the floor rises along the world's x."""
    slope = np.stack([angles, np.zeros(len(angles))], 1)
    return dataclasses.replace(nominal_starts(creature, len(angles)), slope=slope)


def test_another_floor_does_not_change_the_body(tiny):
    before, after = tiny.model.geom_friction.copy(), slippery(tiny, 0.4).model
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
    steep = uphill(tiny, *np.radians([30.0, -30.0]))
    up, down = batch_of(tiny, tiny.model, steep).expand("opt.gravity")
    assert up == pytest.approx([-9.81 / 2, 0, -9.81 * np.sqrt(3) / 2])
    assert down == pytest.approx([9.81 / 2, 0, -9.81 * np.sqrt(3) / 2])


def test_a_standing_body_slides_if_friction_is_below_the_slope(tiny):
    held, slid = (
        simulate(
            slippery(tiny, friction),
            make_champion(tiny),
            uphill(tiny, *[np.arctan(0.25)] * 2),
            1.5,
            fall=Fall(min_up=-1, height=(0, 5), touch=False),
        ).travel[:, 0]
        for friction in (0.6, 0.1)
    )
    assert (slid < held - 0.3).all()
