"""Settings of the task of hopping to a goal."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import (
    SHAPE,
    STRICT,
    Finite,
    NonNegative,
    Whole,
)

GOALS = (0.4, 2.0)
"""m ahead of the start: the nearest and the farthest goal."""
NOMINAL_GOAL = 1.2
"""m, of the trial that nobody disturbs."""
NEAR = 0.05
"""Share of the goal's distance; who is nearer has arrived."""
OnTheWay = Annotated[float, pydantic.Field(gt=0, lt=1)]


@dataclasses.dataclass(frozen=True)
class HopWeights:
    """Weight of each fitness term; all are penalties.

    mjxgait/tasks/hop/fitness.py says to the letter what each measures. As long as those of
    style, all but `distance` and `missed`, sum up to less than `distance`, getting nearer is
    worth its manner.

    Attributes:
      distance: goal distances that are left at the end.
      missed: 1 for who is not within a twentieth of the goal distance.
      time: share of the time until it arrived.
      restless: way made after the arrival, in goal distances.
      ground: share of the time on parts that must not touch the floor.
      fall: 1 for an episode that ended with a fall.
      neutral: how far joints are from standing in the end, in halves of their ranges.
      fast: the fastest that a joint turned: nothing up to 14 rad/s, 1 from 20 on.
      overlap: how deep parts are in each other.
      energy: work of the joints per weight and way (cost of transport); 0: it is no term.
      sub_goals: how near it came to each of `fitness.sub_goals`; 0: it is no term.
    """

    __pydantic_config__ = STRICT
    distance: Finite = 1.0
    missed: Finite = 0.3
    time: Finite = 0.1
    restless: Finite = 0.2
    ground: Finite = 0.2
    fall: Finite = 0.2
    neutral: Finite = 0.1
    fast: Finite = 0.04
    overlap: Finite = 0.1
    energy: Annotated[Finite, SHAPE] = 0.0
    sub_goals: Annotated[Finite, SHAPE] = 0.0


@dataclasses.dataclass(frozen=True)
class GoalConfig:
    """What is wanted of every way to a goal.

    Attributes:
      style_ramp: generations over which the style terms grow to their full weight.
      rest: s without motion after which the rest of an episode is not simulated: whoever senses
        nothing new does nothing new. 0 simulates all of it.
    """

    __pydantic_config__ = STRICT
    style_ramp: Whole = 20
    rest: NonNegative = 1.25


@dataclasses.dataclass(frozen=True)
class HopConfig(GoalConfig):
    """What is wanted of the way to one goal.

    Attributes:
      sub_goals: points on the straight way from the start to the goal that are to be passed, as
        shares of that way; read only if the weight of that name is not 0.
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    sub_goals: Annotated[tuple[OnTheWay, ...], pydantic.Field(min_length=1), SHAPE] = (
        0.25,
        0.5,
        0.75,
    )
    weights: HopWeights = dataclasses.field(default_factory=HopWeights)


@dataclasses.dataclass(frozen=True)
class TravelWeights:
    """See `HopWeights`.

    Attributes:
      distance: of the way that is left to the nominal goal, below zero beyond it.
      ground: share of the time on parts that must not touch the floor.
      fall: 1 for an episode that ended with a fall.
      fast: the fastest that a joint turned: nothing up to 14 rad/s, 1 from 20 on.
      overlap: how deep parts are in each other.
    """

    __pydantic_config__ = STRICT
    distance: Finite = 1.0
    ground: Finite = 0.2
    fall: Finite = 0.2
    fast: Finite = 0.1
    overlap: Finite = 0.1


@dataclasses.dataclass(frozen=True)
class TravelConfig(GoalConfig):
    """What is wanted of the way from goal to goal.

    Attributes:
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    weights: TravelWeights = dataclasses.field(default_factory=TravelWeights)
