"""Settings of swimming."""

import dataclasses

from mjxgait.settings.tables import STRICT, NonNegative, Positive


@dataclasses.dataclass(frozen=True)
class SwimWeights:
    """What each term counts; `overlap` is a penalty.

    Attributes:
      speed: m/s of the way, as far as the blocks are apart.
      overlap: how deep blocks are in each other.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 1.0
    overlap: NonNegative = 1.0


@dataclasses.dataclass(frozen=True)
class SwimConfig:
    """The fitness of swimmers.

    Attributes:
      settle: s from the start that do not count.
      overlap: m, how deep blocks are in each other of which half the speed counts.
      apart: generations until that counts in full: who cannot swim yet has nothing to lose by
        it.
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    settle: NonNegative = 2.0
    overlap: Positive = 0.05
    apart: Positive = 50.0
    weights: SwimWeights = dataclasses.field(default_factory=SwimWeights)
