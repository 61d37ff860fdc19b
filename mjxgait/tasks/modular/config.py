"""Settings of what bodies of blocks are to do."""

import dataclasses

from mjxgait.config.tables import STRICT, NonNegative, Positive


@dataclasses.dataclass(frozen=True)
class BlocksConfig:
    """What all of them have.

    Attributes:
      settle: s from the start that do not count.
      overlap: how deep blocks are in each other or in the ground, of the smaller one's size, of
        which half counts of what was done.
      apart: generations until that counts in full; 0: from the first on.
    """

    __pydantic_config__ = STRICT
    settle: NonNegative = 2.0
    overlap: Positive = 0.05
    apart: NonNegative = 0.0


@dataclasses.dataclass(frozen=True)
class SwimWeights:
    """What each term counts; `overlap` and `elsewhere` are penalties.

    Attributes:
      speed: m/s of the way, as the crow flies.
      overlap: what of the speed is lost by blocks that stand in each other.
      elsewhere: what of the rest is lost by momentum that the water did not give.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 1.0
    overlap: NonNegative = 1.0
    elsewhere: NonNegative = 1.0


@dataclasses.dataclass(frozen=True)
class SwimConfig(BlocksConfig):
    """The fitness of swimmers.

    Attributes:
      elsewhere: share of its momentum that the water did not give, of which half the speed counts: a
        step of finite length gives some to those that find out how.
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    elsewhere: Positive = 0.02
    weights: SwimWeights = dataclasses.field(default_factory=SwimWeights)


@dataclasses.dataclass(frozen=True)
class RoamWeights:
    """What each term counts; `overlap` and `balance` are penalties.

    Attributes:
      speed: m/s of the way over ground, as the crow flies.
      overlap: what of the speed is lost by blocks that stand in each other or in the ground.
      balance: what of the rest is lost by tipping over.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 1.0
    overlap: NonNegative = 1.0
    balance: NonNegative = 1.0


@dataclasses.dataclass(frozen=True)
class RoamConfig(BlocksConfig):
    """The fitness of blocks that walk.

    Attributes:
      tilt: deg, the farthest that the root has tipped from how it lay when it had settled, of which
        half the speed counts.
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    apart: NonNegative = 10.0
    tilt: Positive = 45.0
    weights: RoamWeights = dataclasses.field(default_factory=RoamWeights)


@dataclasses.dataclass(frozen=True)
class JumpWeights:
    """What each term counts; all but `height` are penalties.

    Attributes:
      height: m, of the lowest part at the best moment, mean of the halves of the time that counts.
      overlap: what of it is lost by blocks that stand in each other or in the ground.
      wild: what of the rest is lost by an episode that ends early: its share that was not lived.
    """

    __pydantic_config__ = STRICT
    height: NonNegative = 1.0
    overlap: NonNegative = 1.0
    wild: NonNegative = 1.0


@dataclasses.dataclass(frozen=True)
class JumpConfig(BlocksConfig):
    """The fitness of blocks that jump.

    Attributes:
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    overlap: Positive = 0.035
    weights: JumpWeights = dataclasses.field(default_factory=JumpWeights)
