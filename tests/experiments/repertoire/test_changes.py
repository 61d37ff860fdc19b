"""Changes from one walk to another in motion, each commanded at its own moment."""

import dataclasses
import pickle
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from experiments.repertoire.made_up import CERTIFIED, begin, examine
from rendering.made_up import falling, treading

from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire import neighbours
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.neighbours import (
    SECONDS,
    changes,
    commanded_headings,
    succeeds,
)
from mjxgait.reference.changing import ChangingReference
from mjxgait.reference.outcome import Trajectory
from mjxgait.reference.starts import nominal_starts
from mjxgait.rendering.walk import record_walk

LARGE, SMALL = 35.0, 30.0
MOMENTS, SETTLES, WATCHED = 2, 2.0, 2.0
"""Moments of change, and s after it; the shipped values are larger."""
CHANGES = np.array([1.0, 1.5, np.inf])


@pytest.fixture(autouse=True)
def few_moments(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("MOMENTS", MOMENTS), ("SETTLES", SETTLES), ("WATCHED", WATCHED)):
        monkeypatch.setattr(neighbours, name, value)


def one_by_one(work: Callable, ways: Sequence, tell: Callable[[int, int], object], **_) -> list:
    """Stand-in for `one_per_core`: the work is pickled, but done in this process."""
    found = []
    for number, way in enumerate(ways, 1):
        found.append(pickle.loads(pickle.dumps(work))(pickle.loads(pickle.dumps(way))))
        tell(number, len(ways))
    return found


def film(creature: Creature, before: Champion, after: Champion, seconds: float = 3.0) -> Trajectory:
    step = creature.model.opt.timestep
    reference = ChangingReference(creature, before, after, step, CHANGES, SECONDS)
    starts = nominal_starts(creature, len(CHANGES))
    count = len(CHANGES)
    return simulate(
        creature, before, starts, seconds, record=count, threads=1, reference=reference
    ).trajectory


def walking_at(creature: Creature, champion: Champion) -> Champion:
    """The champion with its own speed as its target."""
    walk = record_walk(creature, champion, 6.0)
    chords = walk.qpos[200:, :2] - walk.qpos[:-200, :2]
    speed = float(np.linalg.norm(chords[-1000:], axis=1).mean())
    return dataclasses.replace(champion, wish={"speed": speed})


@pytest.mark.parametrize("advance", ["clock", "error"])
def test_a_walk_is_unchanged_until_the_command(stool: Creature, advance: str):
    """Also with `advance = "error"`, where the cycle waits for the body."""
    before, after = (
        dataclasses.replace(
            champion, settings=dataclasses.replace(champion.settings, advance=advance)
        )
        for champion in (treading(stool, LARGE), treading(stool, SMALL))
    )
    found, usual = film(stool, before, after), record_walk(stool, before, 3.0)
    known = usual.trajectory.target[0, : found.target.shape[1]]
    np.testing.assert_allclose(found.target[2], known, atol=1e-9)
    for row, change in enumerate(CHANGES[:2]):
        at = round(change / usual.time_step) + 1
        np.testing.assert_allclose(found.target[row, :at], known[:at], atol=1e-9)
        assert np.abs(found.target[row, at + 20 :] - known[at + 20 :]).max() > 0.01


def test_the_new_walk_is_followed_after_the_change(stool: Creature):
    """Slower, with larger poses; the phase never jumps."""
    before, after = treading(stool, SMALL), treading(stool, LARGE, period=0.8)
    found, step = film(stool, before, after), stool.model.opt.timestep
    moved = np.diff(found.phase, axis=1) % 1.0
    changed = round((CHANGES[0] + SECONDS) / step) + 1
    np.testing.assert_allclose(moved[2], step / 0.5, atol=1e-9)
    np.testing.assert_allclose(moved[0, changed:], step / 0.8, atol=1e-9)
    assert (moved >= step / 0.8 - 1e-9).all()
    assert (moved <= step / 0.5 + 1e-9).all()
    wide, narrow = (np.ptp(found.target[row, changed:], axis=0) for row in (0, 2))
    np.testing.assert_allclose(wide / narrow, LARGE / SMALL, rtol=0.02)


def test_a_change_succeeds_where_the_new_speed_is_held(stool: Creature):
    before, after = (
        walking_at(stool, treading(stool, degrees, period=0.8)) for degrees in (SMALL, LARGE)
    )
    too_fast = dataclasses.replace(after, wish={"speed": 1.3 * after.wish["speed"]})
    assert succeeds(stool, before, after).tolist() == [True] * MOMENTS
    assert not succeeds(stool, before, too_fast).any()


def test_a_change_that_ends_in_a_fall_fails(stool: Creature, monkeypatch: pytest.MonkeyPatch):
    """Even at the new speed and heading."""
    before = walking_at(stool, treading(stool, LARGE))
    fallen = dataclasses.replace(falling(stool), wish=before.wish)
    monkeypatch.setattr(neighbours, "_as_commanded", lambda *_: np.ones(MOMENTS, bool))
    assert succeeds(stool, before, before).all()
    assert not succeeds(stool, before, fallen).any()


def test_the_commanded_turn_rate_changes_from_one_walk_to_the_other(stool: Creature):
    straight = dataclasses.replace(treading(stool), wish={"speed": 0.2})
    turning = dataclasses.replace(straight, wish={"speed": 0.2, "turn": 30.0})
    moments, step = np.array([1.0, 2.0]), 0.01
    assert commanded_headings(straight, straight, moments, 500, step) is None
    told = np.degrees(commanded_headings(straight, turning, moments, 500, step))
    rates = np.diff(told, axis=1) / step
    for row, moment in enumerate((100, 200)):
        np.testing.assert_allclose(told[row, : moment + 1], 0.0, atol=1e-9)
        assert 0 < rates[row, moment + 50] < 30
        np.testing.assert_allclose(rates[row, moment + 101 :], 30.0)
    back = np.degrees(commanded_headings(turning, straight, moments, 500, step))
    np.testing.assert_allclose(back[0, :100], 0.3 * np.arange(100), atol=1e-9)
    np.testing.assert_allclose(back[0, 201:], back[0, -1])


def test_neighbours_change_in_both_directions(
    stool: Creature, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Between straight and turning; a change with the wrong heading fails."""
    monkeypatch.setattr(neighbours, "one_per_core", one_by_one)
    folder, creature, grid = begin(tmp_path / "set")
    examine(folder, creature, grid)
    found = [Found(cell, cell in CERTIFIED, 0.2, 0.0, 0.5, "trot", 0.3, ()) for cell in grid.cells]
    told: list[tuple[int, int]] = []
    made = changes(folder, creature, grid, found, lambda *at: told.append(at))
    straight, turning = CERTIFIED
    assert [(c.begins, c.ends) for c in made] == [(straight, turning), (turning, straight)]
    assert told == [(1, 2), (2, 2)]
    assert made[0].share == 0
    assert made[0].entry == {
        "from": straight.name,
        "to": turning.name,
        "seconds": SECONDS,
        "share": 0.0,
    }
