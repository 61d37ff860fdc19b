"""Thresholds for the tasks with a goal: hop, limbo and travel."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import (
    STRICT,
    Fraction,
    NonNegative,
    Positive,
)


@dataclasses.dataclass(frozen=True)
class GoalThresholds:
    """Thresholds common to tasks with a goal, in place of criteria 1 to 3 and 7.

    Attributes:
      nominal: m, goal of the undisturbed recording. goals: m, range of the others.
      min_up: least product of the trunk's up axis with the world's; below it the body has fallen.
      arrive: share of the perturbed starts that must succeed.
    """

    __pydantic_config__ = STRICT
    nominal: Positive = 1.2
    goals: tuple[Positive, Positive] = (0.4, 2.0)
    min_up: Annotated[float, pydantic.Field(ge=-1, le=1)] = 0.2
    arrive: Fraction = 0.9


@dataclasses.dataclass(frozen=True)
class HopThresholds(GoalThresholds):
    """Thresholds for `hop`.

    Attributes:
      near: share of the goal distance within which the goal counts as reached.
      stay: s at the end, all of them near the goal.
    """

    __pydantic_config__ = STRICT
    near: Positive = 0.05
    stay: Positive = 5.0


@dataclasses.dataclass(frozen=True)
class LimboThresholds(HopThresholds):
    """Thresholds for `limbo`: those of `hop`, and the clearance.

    Attributes:
      place: m ahead of the start, of the bar's middle. height: m, of its lower edge.
      clearance: m between every part and the bar, or the space above it.
    """

    __pydantic_config__ = STRICT
    nominal: Positive = 1.4
    goals: tuple[Positive, Positive] = (1.0, 2.0)
    place: Positive = 0.6
    height: Positive = 0.35
    clearance: NonNegative = 0.0


@dataclasses.dataclass(frozen=True)
class TravelThresholds(GoalThresholds):
    """Thresholds for `travel`: goal distances as for `hop`.

    The task defines the distance at which a goal counts as reached (docs/reference/hop.md); it is
    no threshold.

    Attributes:
      speed: m/s, least. second_half: speed of the second half over that of the first.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.15
    second_half: Positive = 0.8
