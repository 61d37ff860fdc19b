"""Settings of the network controller, and what it observes."""

import dataclasses
import itertools
from typing import Annotated

import pydantic

from mjxgait.config.tables import SHAPE, STRICT, Positive
from mjxgait.controllers.config import check_every

JOINTS = ("joint_pos", "joint_vel")
"""Observations of every joint."""
MIRRORED = {
    "trunk_height": 1.0,
    "up_vel": 1.0,
    "pitch": 1.0,
    "pitch_rate": 1.0,
    "roll": -1.0,
    "roll_rate": -1.0,
    "heading": -1.0,
    "aside": -1.0,
}
"""Observations that are one number, with their sign in the mirror image."""
READS = (*JOINTS, "nose_vel", *MIRRORED, "time")
"""Observations in the order in which `mjxgait.environment(observe=READS)` gives them."""


def parts(joints: int) -> dict[str, int]:
    """Return how many numbers each observation has, for a body with J joints."""
    return {name: joints if name in JOINTS else 1 + (name == "nose_vel") for name in READS}


SIGNS = (1.0, -1.0, *MIRRORED.values(), -1.0, -1.0)
"""Sign in the mirror image, half a period later, of the network's inputs that are no joints'."""


def layers(joints: int, hidden: tuple[int, ...]) -> list[tuple[int, int]]:
    """Return inputs and outputs of each layer; the clock is two inputs, its sine and cosine."""
    widths = (sum(parts(joints).values()) + 1, *hidden, joints)
    return list(itertools.pairwise(widths))


@dataclasses.dataclass(frozen=True)
class NetworkConfig:
    """Settings of a network that commands joint angles.

    Attributes:
      hidden: units of each hidden layer.
      every: control steps per command; in between the angles stay.
      period: s; of the clock that the network observes as a sine and a cosine.
      weight: largest weight that evolution draws, times the root of a unit's number of inputs.
    """

    __pydantic_config__ = STRICT
    hidden: Annotated[
        tuple[Annotated[int, pydantic.Field(ge=1, le=1024)], ...],
        pydantic.Field(min_length=1),
        SHAPE,
    ] = (64, 64)
    every: Annotated[int, pydantic.AfterValidator(check_every), SHAPE] = 4
    period: Positive = 0.5
    weight: Positive = 2.0
