"""Servos: the catalogue, the load of a hinge's motion on a servo, and the choice of the lightest.

Letters: `T` moments of a motion.
"""

import dataclasses
import math
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pydantic

from mjxgait.config.tables import STRICT, Positive, Share, build, read_toml
from mjxgait.errors import UserError

CATALOGUE = Path(str(resources.files("mjxgait"))) / "hardware" / "servos.toml"
"""The shipped catalogue."""


@dataclasses.dataclass(frozen=True)
class Servo:
    """Servo as in its maker's data sheet.

    Attributes:
      name: of the model.
      stall: N·m, torque at rest.
      speed: rev/min, without load.
      volts: supply at which both hold.
      mass: g.
      size: mm, its three sides.
      drive: what it takes as a command besides an angle: a current, or a share of the voltage.
      source: page or data sheet of the figures.
    """

    __pydantic_config__ = STRICT
    name: str
    stall: Positive
    speed: Positive
    volts: Positive
    mass: Positive
    size: tuple[Positive, Positive, Positive]
    drive: Literal["current", "voltage"]
    source: str

    @property
    def fastest(self) -> float:
        """Speed in rad/s without load."""
        return self.speed * 2 * math.pi / 60

    @property
    def kilograms(self) -> float:
        """Mass in kg."""
        return self.mass / 1000

    @property
    def half(self) -> np.ndarray:
        """Half of its sides [3] in m."""
        return np.array(self.size) / 2000


@dataclasses.dataclass(frozen=True)
class Catalogue:
    """Servos to choose from.

    Attributes:
      continuous: largest rms torque over the stall torque.
      servo: the servos, at least one.
    """

    __pydantic_config__ = STRICT
    continuous: Share
    servo: Annotated[tuple[Servo, ...], pydantic.Field(min_length=1)]


def read_catalogue(path: Path = CATALOGUE) -> Catalogue:
    """Return a catalogue of servos.

    Raises:
      UserError: it cannot be read, or a key is missing, unknown or out of range.
    """
    catalogue = build(Catalogue, read_toml(path), str(path))
    names = [servo.name for servo in catalogue.servo]
    if twice := [name for name in names if names.count(name) > 1]:
        raise UserError(f'{path}: two servos are called "{twice[0]}"; rename one')
    return catalogue


@dataclasses.dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a hinge at its shaft. torque: [T] N·m. speed: [T] rad/s."""

    torque: np.ndarray
    speed: np.ndarray

    @property
    def peak(self) -> float:
        """Largest torque in N·m."""
        return float(np.abs(self.torque).max())

    @property
    def rms(self) -> float:
        """Root of the mean squared torque in N·m."""
        return float(np.sqrt((self.torque**2).mean()))

    @property
    def fastest(self) -> float:
        """Largest speed in rad/s."""
        return float(np.abs(self.speed).max())

    def scaled(self, torque: float, speed: float) -> "Motion":
        """Return the motion with torques and speeds multiplied by these factors."""
        return Motion(self.torque * torque, self.speed * speed)


def load(servo: Servo, motion: Motion, continuous: float) -> float:
    """Return the factor by which a servo must be stronger and faster for a motion; at most 1 fits.

    The torque of a motor at a share of its voltage falls linearly with speed, from the stall torque
    to none without load. So torque / stall + speed / fastest is the share that a moment needs.
    """
    duty = motion.torque / servo.stall + motion.speed / servo.fastest
    warm = motion.rms / (continuous * servo.stall)
    return max(float(np.abs(duty).max()), motion.peak / servo.stall, warm)


def lightest(catalogue: Catalogue, motion: Motion) -> tuple[Servo, float]:
    """Return the lightest servo that can drive a motion and its load; else the least loaded one."""
    loads = [(servo, load(servo, motion, catalogue.continuous)) for servo in catalogue.servo]
    fit: Sequence[tuple[Servo, float]] = [(servo, part) for servo, part in loads if part <= 1]
    if fit:
        return min(fit, key=lambda one: (one[0].mass, one[1]))
    return min(loads, key=lambda one: one[1])
