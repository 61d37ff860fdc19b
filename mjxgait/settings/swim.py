"""Settings of swimming."""

import dataclasses

from mjxgait.settings.tables import STRICT, NonNegative


@dataclasses.dataclass(frozen=True)
class SwimWeights:
    """What each term counts; `overlap` is a penalty."""

    __pydantic_config__ = STRICT
    speed: NonNegative = 1.0
    overlap: NonNegative = 0.1


@dataclasses.dataclass(frozen=True)
class SwimConfig:
    """The fitness of swimmers.

    Attributes:
      settle: s from the start that do not count.
    """

    __pydantic_config__ = STRICT
    settle: NonNegative = 2.0
    weights: SwimWeights = dataclasses.field(default_factory=SwimWeights)
