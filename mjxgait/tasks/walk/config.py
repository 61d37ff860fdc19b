"""Settings of the task of walking."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import (
    SHAPE,
    STRICT,
    Finite,
    NonNegative,
    Positive,
    Whole,
)
from mjxgait.tasks.walk.gaits import AUTO, check_gait

LIKENESS = ("stride", "duty_factor", "reach", "pitch")
"""What a walk is compared with an animal's by."""
WISHES = ("speed", "gait", "turn", "steer", "height", "bounce", "sway", *LIKENESS)
GaitText = Annotated[str, pydantic.AfterValidator(check_gait)]


@dataclasses.dataclass(frozen=True)
class Weights:
    """Weight of each fitness term; all but `distance` and `alive` are penalties.

    mjxgait/tasks/walk/fitness.py says to the letter what each measures.

    Attributes:
      distance: body lengths walked forward.
      alive: share of the episode until it fell; a quarter of that for who goes nowhere.
      drift: way to the side, and turning away.
      fade: how much less far the second half of the time led than the first.
      slip: way that the worst foot slides while it carries weight, per way walked.
      clearance: how far feet stay below the wanted height in their swings.
      frequency: strides per second beyond what an animal of this mass makes.
      duty: feet that are on the floor for less than a quarter or more than four fifths of the
        time.
      airborne: share of the time with no foot on the floor.
      patter: feet that lose the floor for moments while they stand.
      foot_height: feet held high without need.
      tilt: how far the trunk leans, in the mean.
      wobble: how much the trunk turns to and fro.
      touch: share of the time on parts that must not touch the floor.
      energy: work of the joints per weight and way (cost of transport).
      saturation: share of the joints at their torque limits, in the mean.
      limits: share of the joints beyond their pose ranges, in the mean.
      overlap: how deep parts are in each other.
      fall: 1 for an episode that ended with a fall.
      foot_speed: how much faster than 2.25 √(g·h) a foot ever swings; 0: it is no term.
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
    patter: Finite = 0.0
    foot_height: Finite = 1.0
    tilt: Finite = 1.0
    wobble: Finite = 0.1
    touch: Finite = 1.0
    energy: Finite = 0.05
    saturation: Finite = 0.5
    limits: Finite = 0.5
    overlap: Finite = 4.0
    fall: Finite = 0.0
    foot_speed: Annotated[Finite, SHAPE] = 0.0


@dataclasses.dataclass(frozen=True)
class WishWeights:
    """What missing each wish costs at most (mjxgait/tasks/walk/target_terms.py).

    Attributes:
      speed: a speed that is not held.
      gait: footfalls of another gait.
      height: a trunk that is too high or too low.
      bounce: a trunk that goes up and down more, or less.
      sway: a trunk that rolls more, or less.
      stride: strides that are shorter or longer.
      duty_factor: feet that are on the floor for less, or more, of the time.
      reach: feet that are ahead of or behind their hips while they stand.
      pitch: a trunk whose nose points up more, or less.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 4.0
    gait: NonNegative = 6.0
    height: NonNegative = 3.0
    bounce: NonNegative = 3.0
    sway: NonNegative = 3.0
    stride: NonNegative = 4.0
    duty_factor: NonNegative = 4.0
    reach: NonNegative = 2.0
    pitch: NonNegative = 2.0


@dataclasses.dataclass(frozen=True)
class WishConfig:
    """What is asked of a walk besides being one (docs/wishes.md); a key that is not given is free.

    Attributes:
      speed: m/s, held from both sides.
      gait: a name by its footfalls, or auto.
      turn: deg/s, to the left; the heading that it is told to keep turns so fast.
      steer: deg/s; in every disturbed trial the heading that it is told to keep turns at a rate of
        its own, up to this, to the left or to the right; it must obey others too.
      height: of the trunk while walking, in standing heights.
      bounce: of the trunk's height about its mean, in hip heights, root mean square.
      sway: deg, of the trunk's roll, root mean square.
      stride: stride length over that of an animal with such legs at its own speed.
      duty_factor: mean duty factor over that of such an animal.
      reach: hip heights, where feet are in the middle of their stances, ahead of or behind where
        they stand at rest; mean of the feet.
      pitch: deg, of the trunk's nose above the horizon, mean.
      weights: what each wish counts.
    """

    __pydantic_config__ = STRICT
    speed: Positive | None = None
    gait: Annotated[GaitText, SHAPE] = AUTO
    turn: Finite | None = None
    steer: Positive | None = None
    height: Positive | None = None
    bounce: NonNegative | None = None
    sway: NonNegative | None = None
    stride: Positive | None = None
    duty_factor: Positive | None = None
    reach: NonNegative | None = None
    pitch: Finite | None = None
    weights: WishWeights = dataclasses.field(default_factory=WishWeights)

    def __post_init__(self) -> None:
        if self.turn is not None and self.steer is not None:
            raise ValueError("turn and steer: who turns all the time is not steered; give one")

    @property
    def asked(self) -> tuple[str, ...]:
        """Names of the wishes that there are."""
        values = {name: getattr(self, name) for name in WISHES}
        # A value may be traced, which compares with nothing.
        free = [n for n, v in values.items() if v is None or (isinstance(v, str) and v == AUTO)]
        return tuple(name for name in WISHES if name not in free)

    @property
    def table(self) -> dict[str, float | str]:
        """The wishes that there are, by name."""
        return {name: getattr(self, name) for name in self.asked}


@dataclasses.dataclass(frozen=True)
class WalkConfig:
    """What is wanted of a gait.

    Attributes:
      speed: body lengths per second up to which faster is better; beyond it distance counts a
        fiftieth, so that a gait gets steadier and not faster. 0 sets no limit.
      clearance: height in hip heights that each foot should reach in each stride.
      frequency: share of the highest stride frequency of an animal of this mass up to which a
        gait is not hasty.
      contact: m above the floor below which a foot counts as down; 0: only one that bears weight
        does, as in the examination.
      hardening: steps in which the disturbances of the trials grow to their full size, one after
        each generation whose best stay up; 0: in full from the first on.
      style_ramp: generations over which the style terms (all but distance, alive, foot_height
        and fall) grow to their full weight.
      weights: what each term counts.
      wish: what else is asked: a speed, a gait, a turn, a posture.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.9
    clearance: NonNegative = 0.12
    frequency: NonNegative = 0.7
    contact: Annotated[NonNegative, SHAPE] = 0.002
    hardening: Annotated[Whole, SHAPE] = 0
    style_ramp: Whole = 0
    wish: WishConfig = dataclasses.field(default_factory=WishConfig)
    weights: Weights = dataclasses.field(default_factory=Weights)
