"""What is demanded of bodies of blocks: to swim, to walk, to jump, to follow a light."""

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
class BlocksConfig:
    """What is demanded of all bodies of blocks, instead of 1 to 5 and 7.

    Attributes:
      arrive: share of the perturbed starts that must do what is demanded.
      body_speed: m/s, of the fastest block. overlap: of the smaller block's size, the cube root of
        its volume, how deep blocks may stand in each other that no joint joins, or in the ground.
      again: largest relative change of what evolution saw.
    """

    __pydantic_config__ = STRICT
    arrive: Fraction = 0.9
    body_speed: Positive = 5.0
    overlap: Positive = 0.05
    again: Positive = 0.2


@dataclasses.dataclass(frozen=True)
class GoingConfig(BlocksConfig):
    """What is demanded of those that are to get on.

    Attributes:
      speed: m/s, least, as the crow flies. straight: least way over path. second_half: its speed
        over the first half's.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.2
    straight: Fraction = 0.5
    second_half: Positive = 0.7


@dataclasses.dataclass(frozen=True)
class JumpConfig(BlocksConfig):
    """What is demanded of who jumps. height: m, least, of the lowest part at the best moment of every
    two seconds, in the mean.
    """

    __pydantic_config__ = STRICT
    height: NonNegative = 0.1


@dataclasses.dataclass(frozen=True)
class SwimConfig(GoingConfig):
    """What is demanded of who swims.

    Attributes:
      elsewhere: momentum that is not the water's, as a share of all that was exchanged with it.
    """

    __pydantic_config__ = STRICT
    elsewhere: Positive = 0.05


@dataclasses.dataclass(frozen=True)
class RoamConfig(GoingConfig):
    """What is demanded of blocks that walk.

    Attributes:
      min_up: least product of the world's up axis with the root's own direction that was up when it
        had settled.
    """

    __pydantic_config__ = STRICT
    min_up: Annotated[float, pydantic.Field(ge=-1, le=1)] = 0.5


@dataclasses.dataclass(frozen=True)
class FollowConfig(BlocksConfig):
    """What is demanded of who follows a light, besides what is of who swims or walks.

    Attributes:
      speed: m/s, least, by which the light comes nearer.
      arrive: share of the perturbed starts, each with a light of its own, in which it does.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.1
    arrive: Fraction = 0.75
