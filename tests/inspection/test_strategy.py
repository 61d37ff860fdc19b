"""The word for a motion, on motions that are made up: each shows what its word means."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mjxgait.inspect.strategy import (
    UNNAMED,
    WORDS,
    Motion,
    lag_of_wave,
    strategy,
    swinging,
    turning,
    where_it_swings,
)

STEP, FRAMES = 0.02, 500
TIMES = STEP * np.arange(FRAMES)
CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(-1, 3)
HALF = np.array([0.1, 0.05, 0.05])
X, Y, Z = np.eye(3)


def wave(amount, direction, lag=0.0):
    """Places [T, 3] m of a part that swings to and fro once a second; lag: deg."""
    return amount * np.sin(2 * np.pi * TIMES - np.radians(lag))[:, None] * direction


def motion(parts, speed=0.5, turn=None, water=True, halves=None):
    """Boxes at places [3] or [T, 3] m that go on along X at a speed in m/s; the first may turn."""
    still = np.tile(np.eye(3), (FRAMES, 1, 1))
    turn = still if turn is None else turn
    halves = [HALF] * len(parts) if halves is None else halves
    points = []
    for number, (place, half) in enumerate(zip(parts, halves, strict=True)):
        corners = np.einsum("tij,kj->tki", still if number else turn, CORNERS * half)
        at = np.broadcast_to(place, (FRAMES, 3)) + speed * TIMES[:, None] * X
        points.append(corners + at[:, None])
    volume = np.array([8 * half.prod() for half in halves])
    return Motion(np.stack(points, 1), turn, volume, STEP, water)


def turned(axis, per_second):
    """Rotations [T, 3, 3] at an even rate."""
    angle = 2 * np.pi * per_second * TIMES
    return Rotation.from_rotvec(angle[:, None] * axis).as_matrix()


def rocked(axis, degrees):
    """Rotations [T, 3, 3] to and fro."""
    return Rotation.from_rotvec(wave(np.radians(degrees), axis)).as_matrix()


def on_ground(*places):
    return [np.asarray(place, float) + 0.05 * Z for place in places]


ABOUT = np.zeros(3)
LONG, FOOT = np.array([0.2, 0.1, 0.05]), np.array([0.03, 0.03, 0.05])
TAIL = [ABOUT, -0.2 * X, -0.4 * X + wave(0.1, Y)]
LIFTED = np.maximum(wave(0.1, Z), 0.0)
LEAPS = np.abs(wave(0.3, Z))
ARCH = [0.3 * X - wave(0.1, X), (0.12 + wave(0.12, X)[:, :1]) * Z, -0.3 * X + wave(0.1, X)]
MOTIONS = {
    "undulate": motion([-0.2 * n * X + wave(0.05, Y, 60 * n) for n in range(4)]),
    "wag": motion(TAIL),
    "scull": motion([ABOUT, 0.2 * Y + wave(0.1, Z), -0.2 * Y + wave(0.1, Z)]),
    "paddle": motion([ABOUT, 0.2 * Y + wave(0.1, X), -0.2 * Y + wave(0.1, X, 180)]),
    "spin": motion([ABOUT, -0.2 * X], turn=turned(X, 0.5)),
    "walk": motion(
        [0.3 * Z, *on_ground(0.1 * X + LIFTED, -0.1 * X + LIFTED[::-1])],
        water=False,
        halves=[LONG, FOOT, FOOT],
    ),
    "crawl": motion(
        on_ground(ABOUT, 0.2 * Y + wave(0.08, X), -0.2 * Y + wave(0.08, X, 180)),
        water=False,
        halves=[LONG, HALF, HALF],
    ),
    "rock": motion(on_ground(ABOUT, -0.2 * X), turn=rocked(Y, 12.0), water=False),
    "inchworm": motion(on_ground(*ARCH), speed=0.2, water=False),
    "hop": motion(on_ground(LEAPS, LEAPS - 0.2 * X), water=False),
    "jump": motion(on_ground(LEAPS, LEAPS - 0.2 * X), speed=0.0, water=False),
    "roll": motion([0.1 * Z], turn=turned(Y, 0.8), water=False, halves=[np.full(3, 0.1)]),
}
NAMELESS = {
    "a swimmer that is towed": motion([ABOUT, -0.2 * X]),
    "a swimmer on the spot": motion(TAIL, speed=0.0),
    "a block that slides": motion(on_ground(ABOUT, -0.2 * X), water=False),
    "a block that lies": motion(on_ground(ABOUT), speed=0.0, water=False),
}


@pytest.mark.parametrize("word", MOTIONS)
def test_a_motion_has_the_word_that_it_shows(word: str):
    assert strategy(MOTIONS[word]) == word


def test_every_word_is_shown():
    assert {*MOTIONS, UNNAMED} == set(WORDS)


@pytest.mark.parametrize("name", NAMELESS)
def test_no_word_where_nothing_fits(name: str):
    assert strategy(NAMELESS[name]) == UNNAMED


@pytest.mark.parametrize("word", ["undulate", "wag", "scull", "paddle", "spin"])
def test_water_has_no_up(word: str):
    """The word of a swimmer is the same in any attitude."""
    given = MOTIONS[word]
    turn = Rotation.from_euler("xyz", [0.7, -1.1, 2.0]).as_matrix()
    other = Motion(
        given.points @ turn.T, turn @ given.turn @ turn.T, given.volume, given.time_step, True
    )
    assert strategy(other) == word


def test_rolling_leads_ahead():
    backwards = motion([0.1 * Z], turn=turned(Y, -0.8), water=False, halves=[np.full(3, 0.1)])
    assert strategy(backwards) != "roll"


def test_the_swing_of_two_equal_blocks():
    """Each has half of it, for the middle is between them."""
    given = motion([ABOUT, -0.4 * X + wave(0.1, Y)])
    swing = swinging(given)
    amount = np.sqrt((swing[100:-100] ** 2).sum(2).mean(0))
    np.testing.assert_allclose(amount, 0.05 / np.sqrt(2), rtol=0.02)
    along, place = where_it_swings(given, swing)
    assert along == pytest.approx(0.0, abs=1e-4)
    assert place == pytest.approx(0.0, abs=1e-4)


def test_a_tail_swings_behind_the_middle():
    given = MOTIONS["wag"]
    along, place = where_it_swings(given, swinging(given))
    # Of 0.1 m a third goes to the middle: the tail has 4 of 6 parts of the squares, the others 1.
    assert along < 0.01
    assert place * given.length == pytest.approx(4 / 6 * -0.2 + 1 / 6 * 0.2, abs=0.005)


def test_turns_are_counted_and_rocking_is_not():
    net, steady = turning(motion([ABOUT], turn=turned(Z, -0.4)))
    np.testing.assert_allclose(net, [0, 0, -0.4], atol=1e-6)
    assert steady == pytest.approx(1.0)
    net, steady = turning(motion([ABOUT], turn=rocked(Z, 30.0)))
    assert np.linalg.norm(net) < 0.02
    assert steady < 0.05


@pytest.mark.parametrize("way", [1, -1])
def test_a_wave_goes_from_front_to_rear(way: int):
    given = motion([-0.2 * n * X + wave(0.05, Y, 90 * way * n) for n in range(5)])
    found = lag_of_wave(given, given.places - given.middle[:, None])
    # The middle swings by a fifth of one part, as the foremost and the hindmost do.
    assert found == pytest.approx(360.0 if way == 1 else 0.0, abs=1.0)
