"""What is demanded of who has a goal: to hop to it, beneath a bar, or from goal to goal."""

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
class GoalConfig:
    """What is demanded of who has a goal, instead of 1 to 3 and 7.

    Attributes:
      nominal: m, the goal of the undisturbed way. goals: m, range of the others.
      min_up: least product of the trunk's up axis with the world's; below it, one has fallen.
      arrive: share of the perturbed starts that must do what the task demands.
    """

    __pydantic_config__ = STRICT
    nominal: Positive = 1.2
    goals: tuple[Positive, Positive] = (0.4, 2.0)
    min_up: Annotated[float, pydantic.Field(ge=-1, le=1)] = 0.2
    arrive: Fraction = 0.9


@dataclasses.dataclass(frozen=True)
class HopConfig(GoalConfig):
    """What is demanded of who hops to a goal.

    Attributes:
      near: share of the goal's distance within which one has arrived.
      stay: s at the end, all of which it is there.
    """

    __pydantic_config__ = STRICT
    near: Positive = 0.05
    stay: Positive = 5.0


@dataclasses.dataclass(frozen=True)
class LimboConfig(HopConfig):
    """What is demanded of who goes to a goal beneath a bar: as of who hops, and to stay clear.

    Attributes:
      place: m ahead of the start, of the bar's middle. height: m, of its lower edge.
      clearance: m that every part must stay away from it, and from all above it.
    """

    __pydantic_config__ = STRICT
    nominal: Positive = 1.4
    goals: tuple[Positive, Positive] = (1.0, 2.0)
    place: Positive = 0.6
    height: Positive = 0.35
    clearance: NonNegative = 0.0


@dataclasses.dataclass(frozen=True)
class TravelConfig(GoalConfig):
    """What is demanded of who travels: goals as of who hops; within which distance one is reached
    is the task's own (docs/hop.md), and no demand.

    Attributes:
      speed: m/s, least. second_half: its speed over the first half's.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.15
    second_half: Positive = 0.8
