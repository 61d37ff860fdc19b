"""Thresholds for the tasks of modular bodies: swim, roam, jump, follow and compete."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import (
    STRICT,
    Count,
    Fraction,
    NonNegative,
    Positive,
)


@dataclasses.dataclass(frozen=True)
class BlocksThresholds:
    """Thresholds common to modular bodies, in place of criteria 1 to 5 and 7.

    Attributes:
      arrive: share of the perturbed starts that must succeed.
      body_speed: m/s, of the fastest block.
      overlap: largest depth of blocks in others that no joint joins, of a block's far end in the
        next one, or of a block in the ground, over the size of the smaller one, the cube root of
        its volume.
      again: largest relative change from the result of evolution.
    """

    __pydantic_config__ = STRICT
    arrive: Fraction = 0.9
    body_speed: Positive = 5.0
    overlap: Positive = 0.05
    again: Positive = 0.2


@dataclasses.dataclass(frozen=True)
class GoingThresholds(BlocksThresholds):
    """Thresholds common to tasks of getting away.

    Attributes:
      speed: m/s, least, in a straight line. straight: least distance over path.
      second_half: speed of the second half over that of the first.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.2
    straight: Fraction = 0.5
    second_half: Positive = 0.7


@dataclasses.dataclass(frozen=True)
class JumpThresholds(BlocksThresholds):
    """Thresholds for `jump`.

    Attributes:
      height: m, least, of the lowest part at the best moment of every two seconds, mean.
    """

    __pydantic_config__ = STRICT
    height: NonNegative = 0.1


@dataclasses.dataclass(frozen=True)
class SwimThresholds(GoingThresholds):
    """Thresholds for `swim`.

    Attributes:
      elsewhere: momentum from other sources than the water, as a share of all exchanged with it.
    """

    __pydantic_config__ = STRICT
    elsewhere: Positive = 0.05


@dataclasses.dataclass(frozen=True)
class RoamThresholds(GoingThresholds):
    """Thresholds for `roam`.

    Attributes:
      min_up: least product of the world's up axis with the direction of the root that was up after
        settling.
    """

    __pydantic_config__ = STRICT
    min_up: Annotated[float, pydantic.Field(ge=-1, le=1)] = 0.5


@dataclasses.dataclass(frozen=True)
class CompeteThresholds(BlocksThresholds):
    """Thresholds for `compete`.

    Attributes:
      share: least mean of the opponent's distance from the cube over the sum of both distances;
        0.5 is a draw.
      arrive: share of the perturbed starts that must be won.
    """

    __pydantic_config__ = STRICT
    share: Fraction = 0.6
    arrive: Fraction = 0.75


@dataclasses.dataclass(frozen=True)
class FollowThresholds(BlocksThresholds):
    """Additional thresholds for `follow`, on top of those for `swim` or `roam`.

    Attributes:
      speed: m/s, least, of the approach to the light.
      arrive: share of the perturbed starts, each with its own light, that must succeed.
      moves: s, time at which the light moves to another side in simulations of their own.
      moved: number of these.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.1
    arrive: Fraction = 0.75
    moves: Positive = 10.0
    moved: Count = 32
