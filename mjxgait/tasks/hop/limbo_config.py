"""Settings of the task of getting to a goal beneath a bar."""

import dataclasses

from mjxgait.config.tables import (
    STRICT,
    Finite,
    NonNegative,
    Positive,
    Whole,
)
from mjxgait.tasks.hop.config import HopConfig, HopWeights

BAR_PLACE = 0.6
"""m ahead of the start; the bar lies across the way, and ends nowhere."""
BAR_RADIUS = 0.01
"""m."""
GOALS = (1.0, 2.0)
"""m ahead of the start, see `settings.hop`: whoever is there has all of its body beyond the bar."""
NOMINAL_GOAL = 1.4
"""m, of the trial that nobody disturbs."""


@dataclasses.dataclass(frozen=True)
class LimboWeights(HopWeights):
    """See `HopWeights`.

    Attributes:
      bar: how deep it was in the place of the bar and of all above it.
    """

    __pydantic_config__ = STRICT
    distance: Finite = 1.5
    bar: Finite = 0.5


@dataclasses.dataclass(frozen=True)
class LimboConfig(HopConfig):
    """What is wanted of the way to a goal beneath a bar.

    Attributes:
      height: m, of the bar's lower edge above the floor.
      higher: m by which it is higher in the first generation.
      lowering: steps in which it comes down from there: one in each generation whose best have
        mastered the step before.
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    height: Positive = 0.35
    higher: NonNegative = 0.12
    lowering: Whole = 12
    weights: LimboWeights = dataclasses.field(default_factory=LimboWeights)
