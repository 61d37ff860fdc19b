"""Acceptance criteria of walk targets, on made-up walks."""

import dataclasses

import numpy as np
import pytest
from certify_made_up import DOG, make_champion, walk
from test_certify_measures import failed

from mjxgait.certification import CertificateConfig
from mjxgait.certification.acceptance import Commands, acceptance_of
from mjxgait.certification.trials import simulate
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome, Trajectory
from mjxgait.reference.starts import nominal_starts
from mjxgait.tasks.walk.target_criteria import (
    draw_commands,
    following,
    in_the_way,
    posture,
    targets_met,
    unrolled,
)

CONFIG = CertificateConfig()


def on_a_circle(rate: float, speed: float = 0.8, late: float = 0.0) -> Recording:
    """Walk that turns at `rate` deg/s, its nose `late` deg behind the commanded heading."""
    straight = walk(speed=speed)
    told = np.radians(rate) * straight.time_step * np.arange(len(straight.trunk_pos))
    heading = told - np.radians(late)
    step = speed * straight.time_step
    way = np.stack([np.cos(heading), np.sin(heading), 0 * told], 1).cumsum(0) * step
    place = way + straight.trunk_pos * [0, 0, 1]
    return dataclasses.replace(straight, trunk_pos=place, heading=heading)


def missed(recording: Recording, **wish) -> set[str]:
    """Names of the failed measures of all criteria under these targets."""
    return failed(*acceptance_of("walk", wish).undisturbed(recording, recording, CONFIG))


@pytest.mark.parametrize(
    ("asked", "hit"), [(0.8, True), (0.75, True), (0.86, True), (0.72, False), (0.9, False)]
)
def test_a_speed_may_be_missed_by_a_tenth_to_either_side(asked: float, hit: bool):
    assert (missed(walk(speed=0.8), speed=asked) == set()) is hit


def test_the_minimum_speed_and_stride_follow_the_target():
    """A slow walk passes only with a slow target."""
    sneaks = walk(speed=0.25, period=0.9)
    assert missed(sneaks, speed=0.25) <= {"worst foot's slip / distance"}
    assert {"speed (body lengths/s)"} <= missed(sneaks)
    for speed in (0.8, 2.0):
        assert following(CONFIG, {"speed": speed}, DOG).progress == CONFIG.progress
    assert following(CONFIG, {"gait": "trot"}, DOG) == CONFIG


@pytest.mark.parametrize("speed", [0.25, 0.4, 0.8])
def test_an_exact_speed_has_a_margin(speed: float):
    """A run continues until its walk has one, however low the target."""
    asked = walk(speed=speed, period=0.9)
    evaluation = acceptance_of("walk", {"speed": speed}).undisturbed(asked, asked, CONFIG)
    speeds = [m for c in evaluation for m in c.measures if "speed" in m.name and "body" in m.name]
    assert min(m.margin for m in speeds) > 0.3


@pytest.mark.parametrize(
    ("phases", "name"),
    [
        ((0.0, 0.5, 0.5, 0.0), "trot"),
        ((0.0, 0.5, 0.0, 0.5), "pace"),
        ((0.0, 0.5, 0.75, 0.25), "walk"),
    ],
)
def test_a_gait_is_identified_by_its_footfalls(phases: tuple[float, ...], name: str):
    for asked in ("trot", "pace", "walk"):
        found = missed(walk(phases=phases), gait=asked)
        assert found == (set() if asked == name else {f"footfalls of a {asked}"})


def test_a_turn_follows_the_commanded_heading():
    turning = on_a_circle(30.0)
    assert missed(turning, turn=30.0) == set()
    assert "off the commanded heading (deg)" in missed(turning, turn=-30.0)
    assert "off the commanded heading (deg)" in missed(on_a_circle(30.0, late=20.0), turn=30.0)
    assert missed(on_a_circle(30.0, late=10.0), turn=30.0) == set()
    # Without the target it is a walk in circles that ends behind its start.
    assert "drift / distance" in missed(turning)
    said = [
        acceptance_of("walk", wish).report(turning, CONFIG)["obstacle"]
        for wish in ({}, {"turn": 30.0})
    ]
    assert said[0].startswith("went backwards")
    assert said[1] is None


def test_an_unrolled_circle_is_straight():
    seen = unrolled(on_a_circle(30.0), {"turn": 30.0})
    assert seen.trunk_pos[-1, 0] == pytest.approx(0.8 * 22.0, rel=1e-3)
    assert abs(seen.trunk_pos[:, 1]).max() < 0.01
    straight = walk()
    assert unrolled(straight, {"speed": 1.0}) is straight


def test_posture_has_two_sided_limits():
    steady = walk()
    found = posture(steady)
    assert found["sway"] == pytest.approx(np.degrees(0.02 / np.sqrt(2)), rel=1e-2)
    for name, room in (("height", 0.05), ("bounce", 0.02), ("sway", 2.0)):
        for side in (-1, 1):
            assert missed(steady, **{name: found[name] + side * 0.9 * room}) == set()
            assert missed(steady, **{name: found[name] + side * 1.1 * room}) != set()


def test_a_missed_target_names_the_number_in_its_way():
    quick = walk(speed=0.8, period=0.4)
    evaluation = acceptance_of("walk", {"speed": 1.5}).undisturbed(quick, quick, CONFIG)
    assert "1.5 m/s" in in_the_way(evaluation)
    assert in_the_way([targets_met(walk(), {"speed": 0.8}, CONFIG)]) is None


def test_the_targets_are_in_the_report():
    told = acceptance_of("walk", {"speed": 0.8}).report(walk(), CONFIG)
    assert told["asked"] == {"speed": 0.8}
    assert "asked" not in acceptance_of("walk").report(walk(), CONFIG)


STEP = 0.005
STEPS = 2400


def told() -> np.ndarray:
    return draw_commands(30.0, 32, STEPS, STEP, np.random.default_rng(0))


def obeying(late: float = 1.0, off: float = 0.0, falls: int = 0) -> Outcome:
    """Simulations that follow their commands `late` s later and `off` deg beside."""
    commands = told()
    behind = round(late / STEP)
    held = np.pad(commands, ((0, 0), (behind, 0)))[:, :STEPS]
    fell = np.where(np.arange(32) < falls, 8.0, np.inf)
    astray = held - commands + np.radians(off)
    astray[fell[:, None] <= STEP * np.arange(STEPS)] = np.nan
    blank = np.zeros((0, 0))
    film = Trajectory(STEP, *[blank] * 5)
    return Outcome(fell, np.zeros((32, 3)), astray, np.full(32, np.inf), film, astray)


def test_commands_start_straight_and_turn_both_ways():
    commands = np.degrees(told())
    assert (commands[:, : round(2.0 / STEP)] == 0).all()
    rates = (commands[:, -1] - commands[:, -2]) / STEP
    assert ((abs(rates) >= 15.0) & (abs(rates) <= 30.0)).all()
    assert (rates > 0).sum() == 16
    assert len(np.unique(rates)) == 32
    assert acceptance_of("walk", {"turn": 30.0}).commands(CONFIG, STEP, None) is None


@pytest.mark.parametrize(
    ("outcome", "passes"),
    [
        (obeying(late=0.4), True),
        (obeying(late=0.4, falls=3), True),
        (obeying(late=0.4, falls=4), False),
        (obeying(late=2.0), False),
        (obeying(late=0.0, off=14.0), True),
        (obeying(late=0.0, off=16.0), False),
    ],
    ids=["soon", "three fall", "four fall", "late", "near", "off"],
)
def test_steering_keeps_the_commanded_heading(outcome: Outcome, passes: bool):
    acceptance, commands = acceptance_of("walk", {"steer": 30.0}), Commands(12.0, told())
    (criterion,) = acceptance.obeyed(outcome, commands, CONFIG)
    assert (criterion.number, criterion.passed) == (11, passes)


def test_a_simulation_reports_its_heading_error(tiny):
    """Two simulations stand, one with a straight command and one with a turn."""
    commands = np.stack([np.zeros(40), np.linspace(0.0, 0.4, 40)])
    starts = nominal_starts(tiny, 2)
    outcome = simulate(tiny, make_champion(tiny), starts, 0.2, heading=commands)
    assert outcome.astray.shape == (2, 40)
    assert abs(outcome.astray[0]).max() < 0.02
    np.testing.assert_allclose(outcome.astray[1], -commands[1], atol=0.02)
    plain = simulate(tiny, make_champion(tiny), starts, 0.2)
    assert plain.astray.size == 0
