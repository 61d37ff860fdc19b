"""The recorded walk behind all pictures."""

import numpy as np
import pytest
from rendering.made_up import falling, treading

from mjxgait.rendering.walk import AFTERMATH, record_walk


def test_steady_strides_are_as_long_as_the_clock_says(stool_walk):
    first, last = stool_walk.steady_strides(2)
    assert (last - first) * stool_walk.time_step == pytest.approx(1.0, abs=0.011)
    assert np.isinf(stool_walk.fell)


def test_targets_are_those_of_the_reference_controller(stool_walk):
    """Without steering and balance the target is the planned pose."""
    from mjxgait.controllers.key_poses.reference import PoseReference

    reference = PoseReference(stool_walk.creature, stool_walk.champion, stool_walk.time_step)
    positions = np.round(stool_walk.trajectory.phase[0] * reference.length).astype(int)
    np.testing.assert_allclose(stool_walk.trajectory.target[0], reference.planned(positions))


def test_a_walk_that_falls_ends_soon_after():
    from mjxgait.config.layers import find_creature
    from mjxgait.creature import load_creature

    walk = record_walk(
        creature := load_creature(find_creature("tall_quadruped")), falling(creature), 6.0
    )
    assert walk.fell < 3.0
    assert walk.seconds == pytest.approx(walk.fell + AFTERMATH, abs=0.02)
    assert walk.steady_strides(8) is None


def test_a_short_walk_has_no_steady_stride(stool):
    assert record_walk(stool, treading(stool), 0.3).steady_strides(1) is None


def test_a_walk_that_diverges_at_once_is_shown_standing(stool, monkeypatch):
    import dataclasses

    from mjxgait.rendering import walk as module

    real = module.simulate

    def broken(*arguments, **options):
        outcome = real(*arguments, **options)
        outcome.trajectory.qpos[:, 1:] = np.nan
        return dataclasses.replace(outcome, fell=np.array([0.005]))

    monkeypatch.setattr(module, "simulate", broken)
    walk = record_walk(stool, treading(stool), 1.0)
    assert np.isfinite(walk.qpos).all()
    assert len(walk.qpos) == 2
    assert walk.steady_strides(1) is None
