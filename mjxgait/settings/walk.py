"""Settings of the task of walking."""

import dataclasses

from mjxgait.settings.tables import STRICT, Finite, NonNegative, Whole


@dataclasses.dataclass(frozen=True)
class Weights:
    """Weight of each fitness term; all but `distance` and `alive` are penalties.

    mjxgait/tasks/walk/fitness.py says to the letter what each measures.

    Attributes:
      distance: body lengths walked forward.
      alive: share of the episode until it fell.
      drift: way to the side, and turning away.
      fade: how much less far the second half of the time led than the first.
      slip: way that the worst foot slides while it carries weight, per way walked.
      clearance: how far feet stay below the wanted height in their swings.
      frequency: strides per second beyond what an animal of this mass makes.
      duty: feet that are on the floor for less than a quarter or more than four fifths of the
        time.
      airborne: share of the time with no foot on the floor.
      foot_height: feet held high without need.
      tilt: how far the trunk leans, in the mean.
      wobble: how much the trunk turns to and fro.
      touch: share of the time on parts that must not touch the floor.
      energy: work of the joints per weight and way (cost of transport).
      saturation: share of the joints at their torque limits, in the mean.
      limits: share of the joints beyond their pose ranges, in the mean.
      overlap: how deep parts are in each other.
      fall: 1 for an episode that ended with a fall.
    """

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
      speed: body lengths per second up to which faster is better; beyond it distance counts a
        fiftieth, so that a gait gets steadier and not faster. 0 sets no limit.
      clearance: height in hip heights that each foot should reach in each stride.
      frequency: share of the highest stride frequency of an animal of this mass up to which a
        gait is not hasty.
      style_ramp: generations over which the style terms (all but distance, alive, foot_height
        and fall) grow to their full weight.
      weights: what each term counts.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.9
    clearance: NonNegative = 0.12
    frequency: NonNegative = 0.7
    style_ramp: Whole = 0
    weights: Weights = dataclasses.field(default_factory=Weights)
