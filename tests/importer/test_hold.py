"""Standing in C MuJoCo under stable PD, by which the importer judges a stance."""

import dataclasses

import pytest

from mjxgait.creature import Creature
from mjxgait.importer.stand_test import Held, hold


def held(stool: Creature, without: str = "") -> Held:
    """On all feet but one."""
    feet, gains = {f"{name}_foot" for name in stool.feet.names if name != without}, stool.gains
    return hold(stool.model, stool.stand_qpos, gains.kp, gains.kd, gains.torque_limit, feet, 0.5)


def test_the_stool_stands_on_its_feet(stool: Creature):
    found = held(stool)
    assert found.stands
    assert found.touched == ""


@pytest.mark.parametrize("foot", ["front_left", "hind_right"])
def test_who_leans_on_what_may_not_touch_the_floor_does_not_stand(stool: Creature, foot: str):
    """The part is named."""
    found = held(stool, foot)
    assert found.touched == foot
    assert not found.stands
    assert dataclasses.replace(found, touched="").stands
