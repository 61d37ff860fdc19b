"""Settings that all controllers share: control steps per command, and the drive."""

import dataclasses
from typing import Literal

from mjxgait.config.tables import STRICT, Positive

HOLDS = (1, 2, 4, 8, 16)
"""Allowed control steps per command."""


def check_every(steps: int) -> int:
    """Return `steps`, the control steps per command, if allowed.

    Raises:
      ValueError: it is not in `HOLDS`.
    """
    if steps not in HOLDS:
        raise ValueError(f"must be one of {', '.join(map(str, HOLDS))} control steps")
    return steps


@dataclasses.dataclass(frozen=True)
class DriveConfig:
    """Settings of the drive: joint motors that follow a controller's commands.

    Attributes:
      law: stable PD, or plain PD for comparison.
      constraint_forces: whether stable PD includes the constraint forces of the previous step,
        as in DART's tutorial.
      stiffness: factor on the creature's kp.
      damping: factor on the creature's kd.
    """

    __pydantic_config__ = STRICT
    law: Literal["spd", "pd"] = "spd"
    constraint_forces: bool = False
    stiffness: Positive = 1.0
    damping: Positive = 1.0
