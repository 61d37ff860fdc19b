"""Settings of the tasks hop, limbo and travel."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import SHAPE, STRICT, Finite, NonNegative, Positive, Whole

GOALS = (0.4, 2.0)
"""Nearest and farthest goal, in m ahead of the start."""
NOMINAL_GOAL = 1.2
"""Goal of the undisturbed trial, in m."""
NEAR = 0.05
"""Share of the goal distance within which the goal counts as reached."""
OnTheWay = Annotated[float, pydantic.Field(gt=0, lt=1)]


@dataclasses.dataclass(frozen=True)
class HopWeights:
    """Weight of each fitness term; all are penalties.

    mjxgait/tasks/hop/fitness.py has the exact definitions. As long as the style terms, all but
    `distance` and `missed`, sum up to less than `distance`, getting nearer pays despite its style.

    Attributes:
      distance: goal distances that are left at the end.
      missed: 1 unless the end is within a twentieth of the goal distance.
      time: share of the time until the arrival.
      restless: distance moved after the arrival, in goal distances.
      ground: share of the time on parts that must not touch the floor.
      fall: 1 for an episode that ended with a fall.
      neutral: final distance of the joints from standing, in halves of their ranges.
      fast: highest speed of any joint: nothing up to 14 rad/s, 1 from 20 on.
      overlap: depth of body parts in each other.
      energy: work of the joints per weight and distance (cost of transport); a weight of 0 removes
        the term.
      sub_goals: smallest distance to each of `fitness.sub_goals`; a weight of 0 removes the term.
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
    """Parameters of every task with a goal.

    Attributes:
      style_ramp: generations over which the style terms grow to their full weight.
      rest: s without motion after which the rest of an episode is not simulated: without new
        observations there is no new motion. 0 simulates all of it.
    """

    __pydantic_config__ = STRICT
    style_ramp: Whole = 20
    rest: NonNegative = 1.25


@dataclasses.dataclass(frozen=True)
class HopConfig(GoalConfig):
    """Parameters of the hop fitness.

    Attributes:
      sub_goals: points to pass on the straight path from the start to the goal, as shares of it;
        read only if the weight of that name is not 0.
      weights: weight of each term.
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
    """Extension of `HopWeights`.

    Attributes:
      distance: share left of the way to the nominal goal, negative beyond it.
      ground: share of the time on parts that must not touch the floor.
      fall: 1 for an episode that ended with a fall.
      fast: highest speed of any joint: nothing up to 14 rad/s, 1 from 20 on.
      overlap: depth of body parts in each other.
    """

    __pydantic_config__ = STRICT
    distance: Finite = 1.0
    ground: Finite = 0.2
    fall: Finite = 0.2
    fast: Finite = 0.1
    overlap: Finite = 0.1


@dataclasses.dataclass(frozen=True)
class TravelConfig(GoalConfig):
    """Parameters of the travel fitness.

    Attributes:
      weights: weight of each term.
    """

    __pydantic_config__ = STRICT
    weights: TravelWeights = dataclasses.field(default_factory=TravelWeights)


BAR_PLACE = 0.6
"""m ahead of the start; the bar lies across the path and has no ends."""
BAR_RADIUS = 0.01
"""m."""
LIMBO_GOALS = (1.0, 2.0)
"""m ahead of the start, as in `hop.config`; at any goal the whole body is beyond the bar."""
LIMBO_NOMINAL_GOAL = 1.4
"""Goal of the undisturbed trial, in m."""


@dataclasses.dataclass(frozen=True)
class LimboWeights(HopWeights):
    """Extension of `HopWeights`.

    Attributes:
      bar: greatest depth in the bar and in the space above it.
    """

    __pydantic_config__ = STRICT
    distance: Finite = 1.5
    bar: Finite = 0.5


@dataclasses.dataclass(frozen=True)
class LimboConfig(HopConfig):
    """Parameters of the limbo fitness.

    Attributes:
      height: m, of the bar's lower edge above the floor.
      higher: m by which the bar is higher in the first generation.
      lowering: steps in which the bar comes down from there, one after each generation in which the
        best individuals have mastered the current height.
      weights: weight of each term.
    """

    __pydantic_config__ = STRICT
    height: Positive = 0.35
    higher: NonNegative = 0.12
    lowering: Whole = 12
    weights: LimboWeights = dataclasses.field(default_factory=LimboWeights)
