"""Settings of the limbo task."""

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
"""m ahead of the start; the bar lies across the path and has no ends."""
BAR_RADIUS = 0.01
"""m."""
GOALS = (1.0, 2.0)
"""m ahead of the start, as in `hop.config`; at any goal the whole body is beyond the bar."""
NOMINAL_GOAL = 1.4
"""Goal of the undisturbed trial, in m."""


@dataclasses.dataclass(frozen=True)
class LimboWeights(HopWeights):
    """See `HopWeights`.

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
