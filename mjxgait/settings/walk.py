"""Settings of the task of walking."""

import dataclasses

from mjxgait.settings.tables import STRICT, Finite, NonNegative, Whole


@dataclasses.dataclass(frozen=True)
class Weights:
    """Weight of each fitness term (mjxgait/tasks/walk/fitness.py says what each measures); all but `distance` and `alive` are penalties."""

    __pydantic_config__ = STRICT
    distance: Finite = 1.0
    alive: Finite = 0.0
    drift: Finite = 1.0
    fade: Finite = 0.5
    slip: Finite = 10.0
    clearance: Finite = 3.0
    frequency: Finite = 4.0
    duty: Finite = 2.0
    airborne: Finite = 3.0
    foot_height: Finite = 1.0
    tilt: Finite = 1.0
    wobble: Finite = 0.1
    touch: Finite = 1.0
    energy: Finite = 0.05
    saturation: Finite = 0.5
    limits: Finite = 0.5
    overlap: Finite = 4.0
    fall: Finite = 0.0


@dataclasses.dataclass(frozen=True)
class WalkConfig:
    """What is wanted of a gait.

    Attributes:
      speed: body lengths per second up to which faster is better; beyond it distance counts a fiftieth, so that a gait gets steadier and
        not faster. 0 sets no limit.
      clearance: height in hip heights that each foot should reach in each stride.
      frequency: share of the highest stride frequency of an animal of this mass up to which a gait is not hasty.
      style_ramp: generations over which the style terms (all but distance, alive, foot_height and
        fall) grow to their full weight.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.9
    clearance: NonNegative = 0.12
    frequency: NonNegative = 0.7
    style_ramp: Whole = 0
    weights: Weights = dataclasses.field(default_factory=Weights)
