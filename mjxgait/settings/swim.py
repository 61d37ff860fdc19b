"""Settings of swimming."""

import dataclasses

from mjxgait.settings.tables import STRICT, NonNegative, Positive


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
class SwimConfig:
    """The fitness of swimmers.

    Attributes:
      settle: s from the start that do not count.
      overlap: how deep blocks are in each other, of the smaller one's size, of which half the speed
        counts.
      apart: generations until that counts in full: whoever swims fast learns to keep its blocks
        apart more easily than the other way round.
      elsewhere: share of its momentum that the water did not give, of which half the speed counts: a
        step of finite length gives some to those that find out how.
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    settle: NonNegative = 2.0
    overlap: Positive = 0.05
    apart: Positive = 30.0
    elsewhere: Positive = 0.02
    weights: SwimWeights = dataclasses.field(default_factory=SwimWeights)
