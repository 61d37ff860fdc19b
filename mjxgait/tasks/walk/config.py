"""Settings of the walk task."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import (
    ADDED,
    SHAPE,
    STRICT,
    Finite,
    Flag,
    Fraction,
    NonNegative,
    Positive,
    Whole,
)
from mjxgait.tasks.walk.gaits import AUTO, check_gait

LIKENESS = ("stride", "duty_factor", "reach", "pitch")
"""Measures that compare a walk with an animal's."""
TARGETS = ("speed", "gait", "turn", "steer", "height", "bounce", "sway", *LIKENESS)
GaitText = Annotated[str, pydantic.AfterValidator(check_gait)]


@dataclasses.dataclass(frozen=True)
class Weights:
    """Weight of each fitness term; all but `distance` and `alive` are penalties.

    mjxgait/tasks/walk/fitness.py has the exact definitions.

    Attributes:
      distance: body lengths walked forward.
      alive: share of the episode before a fall; without forward progress a quarter of that.
      drift: distance to the side, and turning away.
      fade: how much less distance the second half of the time covers than the first.
      slip: distance that the worst foot slides while it bears weight, per distance walked.
      clearance: how far feet stay below the wanted height in their swings.
      frequency: stride frequency beyond that of an animal of this mass.
      duty: feet that are on the floor for less than a quarter or more than four fifths of the time.
      airborne: share of the time with no foot on the floor.
      patter: contact flicker, feet that lose the floor for moments during stance.
      foot_height: feet held high without need.
      tilt: mean lean of the trunk.
      wobble: rotation of the trunk to and fro.
      touch: share of the time on parts that must not touch the floor.
      energy: work of the joints per weight and distance (cost of transport).
      saturation: mean share of the joints at their torque limits.
      limits: mean share of the joints beyond their pose ranges.
      overlap: depth of body parts in each other.
      fall: 1 for an episode that ended with a fall.
      foot_speed: peak speed of any foot above 2.25 √(g·h); a weight of 0 removes the term.
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
class TargetWeights:
    """Largest cost of missing each target (mjxgait/tasks/walk/fitness.py); a height's is for 0.1.

    Attributes:
      speed: a speed that is not held.
      gait: footfalls of another gait.
      height: a trunk that is too high or too low.
      bounce: a trunk that moves up and down more, or less.
      sway: a trunk that rolls more, or less.
      stride: strides that are shorter or longer.
      duty_factor: feet that are on the floor for less, or more, of the time.
      reach: feet that are ahead of or behind their hips during stance.
      pitch: a trunk with its nose higher, or lower.
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
class TargetConfig:
    """Walk targets (docs/guide/gaits.md); a key that is not given is free.

    Attributes:
      speed: m/s; slower and faster both miss it.
      gait: gait name, defined by its footfalls, or auto.
      turn: deg/s, to the left; rate at which the commanded heading turns.
      steer: deg/s; in each disturbed trial the commanded heading turns left or right at a rate of
        its own, up to this. The walk must obey other rates too.
      height: trunk height while walking, in standing heights.
      bounce: deviation of the trunk height from its mean, in hip heights, root mean square.
      sway: deg, roll of the trunk, root mean square.
      stride: stride length over that of an animal with such legs at the same speed.
      duty_factor: mean duty factor over that of such an animal.
      reach: hip heights; mean position of the feet during stance, ahead of or behind where they
        stand at rest.
      pitch: deg, mean angle of the trunk's nose above the horizon.
      binding: whether the certificate demands the targets too; if not, they only guide the search.
      weights: weight of each target.
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
    binding: Annotated[Flag, SHAPE, ADDED] = True
    weights: TargetWeights = dataclasses.field(default_factory=TargetWeights)

    def __post_init__(self) -> None:
        if self.turn is not None and self.steer is not None:
            raise ValueError("turn and steer exclude each other; give one")

    @property
    def requested(self) -> tuple[str, ...]:
        """Names of the targets that are set."""
        values = {name: getattr(self, name) for name in TARGETS}
        # A traced value cannot be compared.
        free = [n for n, v in values.items() if v is None or (isinstance(v, str) and v == AUTO)]
        return tuple(name for name in TARGETS if name not in free)

    @property
    def table(self) -> dict[str, float | str]:
        """Targets that are set, by name."""
        return {name: getattr(self, name) for name in self.requested}


@dataclasses.dataclass(frozen=True)
class WalkConfig:
    """Parameters of the walk fitness.

    Attributes:
      speed: body lengths per second up to which faster is better; beyond it distance counts a
        fiftieth, so that the gait gets steadier instead of faster. 0 sets no limit.
      clearance: height in hip heights that each foot should reach in each stride.
      frequency: share of the highest stride frequency of an animal of this mass up to which there
        is no penalty.
      contact: m above the floor below which a foot counts as down; 0: only a foot that bears weight
        does, as in certification.
      hardening: steps in which the disturbances of the trials grow to full size, one after each
        generation in which the best individuals stay up; 0: full size from the first generation on.
      style_ramp: generations over which the style terms (all but distance, alive, foot_height and
        fall) grow to their full weight.
      leniency: 0: the style terms count with the covered share of the wanted distance, so that a
        short walk in bad style scores about as little as standing; 1: with that share squared.
      weights: weight of each term.
      wish: further targets: a speed, a gait, a turn, a posture.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 0.9
    clearance: NonNegative = 0.12
    frequency: NonNegative = 0.7
    contact: Annotated[NonNegative, SHAPE] = 0.002
    hardening: Annotated[Whole, SHAPE] = 0
    style_ramp: Whole = 0
    leniency: Annotated[Fraction, ADDED] = 0.0
    wish: TargetConfig = dataclasses.field(default_factory=TargetConfig)
    weights: Weights = dataclasses.field(default_factory=Weights)
