"""Finer physics steps between the same control steps."""

import dataclasses

import numpy as np
import pytest

from mjxgait.certification import record
from mjxgait.certification.certificate import recordings
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.reference.starts import Starts, batch_of, nominal_starts
from mjxgait.reference.stepping import examined_model


def refined(creature: Creature, *refine: int) -> Starts:
    """Nominal starts. refine: physics steps per control step of each."""
    start = nominal_starts(creature, len(refine))
    return dataclasses.replace(start, refine=np.array(refine))


@pytest.mark.parametrize("refine", [1, 2, 4])
def test_a_control_step_keeps_its_length_with_finer_physics(
    tiny: Creature, trotter: Champion, refine: int
):
    """From frame to frame joints move by their speed times the control step."""
    walk = record(tiny, trotter, 1.0, refined(tiny, refine))
    way, speed = np.diff(walk.joint_pos, axis=0).ravel(), walk.joint_vel[1:].ravel()
    assert walk.time_step == 0.005
    assert way @ speed / (speed @ speed) == pytest.approx(0.005, rel=0.1)


def test_the_physics_step_is_divided(tiny: Creature):
    batch = batch_of(tiny, examined_model(tiny), refined(tiny, 1, 2))
    assert batch.expand("opt.timestep").tolist() == [0.005, 0.0025]


def test_simulations_side_by_side_equal_those_alone(tiny: Creature, trotter: Champion):
    together = recordings(tiny, trotter, 1.0, refined(tiny, 1, 2))
    for refine, walk in zip((1, 2), together, strict=True):
        alone = record(tiny, trotter, 1.0, refined(tiny, refine))
        np.testing.assert_array_equal(walk.joint_pos, alone.joint_pos)
    assert not np.array_equal(*(walk.joint_pos for walk in together))
