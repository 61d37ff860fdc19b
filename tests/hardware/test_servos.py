"""Servos: the torque-speed line, heat, and the choice of the lightest."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from mjxgait.errors import UserError
from mjxgait.hardware.servos import (
    CATALOGUE,
    Catalogue,
    Motion,
    Servo,
    lightest,
    load,
    read_catalogue,
)

SERVO = Servo("s", 2.0, 60.0, 12.0, 50.0, (20.0, 30.0, 40.0), "current", "none")
"""Its speed without load is 2π rad/s."""


def brief(torque: float, speed: float) -> Motion:
    """A moment of a torque and a speed in a long rest, which warms no servo."""
    rest = np.zeros(10_000)
    return Motion(np.append(rest, torque), np.append(rest, speed))


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
def test_the_torque_falls_linearly_with_speed(share: float):
    limit = brief(2.0 * (1 - share), share * 2 * np.pi)
    assert load(SERVO, limit, 1.0) == pytest.approx(1.0)
    assert load(SERVO, limit.scaled(-1, -1), 1.0) == pytest.approx(1.0)


def test_a_braking_servo_is_limited_by_its_torque():
    assert load(SERVO, brief(1.5, -2.0), 1.0) == pytest.approx(0.75)


def test_steady_torque_is_limited_by_heat():
    steady = Motion(np.full(100, 0.5), np.zeros(100))
    assert load(SERVO, steady, 0.2) == pytest.approx(0.5 / 0.4)


def test_the_lightest_that_fits_is_chosen_else_the_least_loaded():
    strong = dataclasses.replace(SERVO, name="strong", stall=4.0, mass=90.0)
    fast = dataclasses.replace(SERVO, name="fast", speed=120.0, mass=60.0)
    catalogue = Catalogue(1.0, (strong, fast, SERVO))
    assert lightest(catalogue, brief(0.9, 3.0))[0] == SERVO
    assert lightest(catalogue, brief(0.9, 6.0))[0] == fast
    assert lightest(catalogue, brief(2.1, 0.0))[0] == strong
    servo, excess = lightest(catalogue, brief(8.0, 0.0))
    assert servo == strong
    assert excess == pytest.approx(2.0)


def test_the_shipped_catalogue_names_its_sources():
    servos = read_catalogue().servo
    assert len(servos) >= 6
    assert all("Specifications" in servo.source for servo in servos)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("stall = 0.228", "stall = -1"), "stall"),
        (("stall = 0.228", "stal = 0.228"), "unknown key"),
        (('"XL330-M288-T"', '"XL330-M077-T"'), "two servos are called"),
    ],
)
def test_a_mistake_in_a_catalogue_is_one_sentence(
    tmp_path: Path, change: tuple[str, str], said: str
):
    own = tmp_path / "own.toml"
    own.write_text(CATALOGUE.read_text(encoding="utf-8").replace(*change, 1), encoding="utf-8")
    with pytest.raises(UserError, match=said) as error:
        read_catalogue(own)
    assert str(own) in str(error.value)
