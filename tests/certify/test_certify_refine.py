"""Finer physics steps between the same control steps."""

import numpy as np
import pytest

from mjxgait.certify import record
from mjxgait.certify.stepping import examined_model
from mjxgait.champion import Champion
from mjxgait.creature import Creature


@pytest.mark.parametrize("refine", [1, 2, 4])
def test_a_control_step_lasts_as_long_however_fine_the_physics(
    tiny: Creature, trotter: Champion, refine: int
):
    """Joints come as far from frame to frame as their speed says."""
    walk = record(tiny, trotter, 1.0, refine=refine)
    way, speed = np.diff(walk.joint_pos, axis=0).ravel(), walk.joint_vel[1:].ravel()
    assert walk.time_step == 0.005
    assert way @ speed / (speed @ speed) == pytest.approx(0.005, rel=0.1)


def test_the_step_is_divided(tiny: Creature):
    assert examined_model(tiny).opt.timestep == 0.005
    assert examined_model(tiny, 2).opt.timestep == 0.0025
