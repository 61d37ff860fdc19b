"""Stress tests: one additional disturbance of a walk at a time."""

import dataclasses
import json

import numpy as np
import pytest
from certify_made_up import make_champion

from mjxgait.certification import stress as module
from mjxgait.certification.stress import (
    TRIALS,
    Stress,
    StressConfig,
    Trial,
    stress,
)
from mjxgait.errors import UserError
from mjxgait.rendering.curves import draw_stress, figure

SHORT = StressConfig(starts=4, seconds=0.6, long=1.2)
NAMES = [
    "bumps of 5%",
    "slope of 5° up",
    "slope of 5° down",
    "slope of 5° left",
    "slope of 5° right",
    "friction 0.4",
    "push of 0.3 √(g·h)",
    "trunk +20%",
    "0.02 minutes",
]


def test_standing_is_not_walking_anywhere(tiny):
    """It stays up without progress, which is no walk."""
    told = []
    found = stress(tiny, make_champion(tiny), SHORT, told.append)
    assert told == [trial.name for trial in found.trials] == NAMES
    assert len(NAMES) == TRIALS
    assert not any(trial.passed for trial in found.trials)
    assert not found.passed


def test_a_hasty_stress_test_ends_at_the_first_failure(tiny):
    found = stress(tiny, make_champion(tiny), SHORT, hasty=True)
    assert [trial.name for trial in found.trials] == NAMES[:1]
    assert not found.passed


def test_each_trial_makes_one_change_to_the_same_starts(tiny, trotter, monkeypatch):
    """A trial differs from the plain one only by what its name says; ten minutes by its length."""
    seen = []

    def simulate(creature, champion, starts, seconds, **_):
        seen.append((creature, starts, seconds))
        up = np.ones(len(starts), bool)
        return type("Outcome", (), {"stayed_up": up, "travel": np.full((len(starts), 3), 9.0)})()

    monkeypatch.setattr(module, "simulate", simulate)
    found = stress(tiny, trotter, StressConfig(starts=8))
    assert found.passed
    floors, rest = seen[:4], dict(zip([*NAMES[1:-1], "10 minutes"], seen[4:], strict=True))
    assert [str(creature.terrain) for creature, _, _ in floors] == [
        f"rough:0.05@{i}" if i else "rough:0.05" for i in range(4)
    ]
    plain = rest["10 minutes"][1]
    assert [seconds for _, _, seconds in seen] == [22.0] * 11 + [600.0]
    rise = np.radians(5)
    for name, slope in (("up", [rise, 0]), ("down", [-rise, 0]), ("left", [0, rise])):
        starts = rest[f"slope of 5° {name}"][1]
        np.testing.assert_allclose(starts.slope, np.tile(slope, (8, 1)), atol=1e-9)
        np.testing.assert_array_equal(starts.joint_offset, plain.joint_offset)
    creature, starts, _ = rest["friction 0.4"]
    assert (creature.model.geom_friction[:, 0] == 0.4).all()
    assert (starts.friction == 1).all()
    with_mass_scale = rest["trunk +20%"][1].mass / plain.mass
    assert with_mass_scale[:, tiny.trunk] == pytest.approx(1.2)
    assert np.delete(with_mass_scale, tiny.trunk, axis=1) == pytest.approx(1.0)
    pushed = np.linalg.norm(rest["push of 0.3 √(g·h)"][1].push, axis=1)
    assert pushed == pytest.approx(0.3 * np.sqrt(9.81 * tiny.frame.hip_height))


def test_nine_of_ten_starts_must_succeed():
    trials = (Trial("plain", 1.0, True), Trial("bumps", 0.875, False))
    found = Stress("abc", trials, StressConfig())
    assert not found.passed
    assert found.verdict == "It does not walk anywhere yet."
    assert json.loads(json.dumps(found.document()))["trials"][1]["share"] == 0.875
    with figure((5, 3)) as drawing:
        draw_stress(drawing, found)
        labels = [text.get_text() for text in drawing.axes[0].texts]
    assert labels == ["100%", "88%"]


def test_only_the_shipped_settings_say_that_it_walks_anywhere():
    usual, few = (
        Stress("abc", (Trial("plain", 1.0, True),), config)
        for config in (StressConfig(), StressConfig(starts=1))
    )
    assert usual.verdict == "It walks anywhere."
    assert "by other settings" in few.verdict


def test_only_walks_have_stress_tests(tiny, trotter):
    with pytest.raises(UserError, match="only a walk"):
        stress(tiny, dataclasses.replace(trotter, task="hop"), SHORT)
