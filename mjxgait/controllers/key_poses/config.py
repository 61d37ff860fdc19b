"""Settings of the key-pose controller."""

import dataclasses
import math
from typing import Annotated, Literal

import pydantic

from mjxgait.config.tables import (
    ADDED,
    SHAPE,
    STRICT,
    Count,
    Finite,
    Interval,
    NonNegative,
    Positive,
)


@dataclasses.dataclass(frozen=True)
class TuningRanges:
    """Ranges of the tuning genes (docs/reference/controller.md); equal ends fix one.

    Attributes:
      threshold: rad; pose error, root mean square, below which the target advances.
      period: s; of the cycle, if the clock advances the target.
      steer: gain on deviation from the path (heading and lateral offset).
      pitch: gain on pitch.
      pitch_rate: s; gain on pitch rate.
      roll: gain on roll.
      roll_rate: s; gain on roll rate.
    """

    __pydantic_config__ = STRICT
    threshold: Interval = (0.08, 0.16)
    period: Interval = (0.8, 0.8)
    steer: Interval = (0.0, 2.0)
    pitch: Interval = (0.0, 0.8)
    pitch_rate: Interval = (0.0, 0.1)
    roll: Interval = (0.0, 0.8)
    roll_rate: Interval = (0.0, 0.1)


TUNING = tuple(field.name for field in dataclasses.fields(TuningRanges))
"""Names of the tuning genes, in the order in which genomes hold them."""


StaticInterval = Annotated[Interval, SHAPE]


@dataclasses.dataclass(frozen=True)
class SteppingRanges:
    """Ranges of the genes for stepping under a fall; equal ends fix one.

    Only bodies with weights in `[stepping]` have these genes.

    Attributes:
      step: gain of the swing leg's step ahead, on the trunk's distance ahead of its support.
      step_rate: likewise, on the trunk's speed ahead.
      side: gain of its step to the side, on the trunk's distance beside its support.
      side_rate: likewise, on the trunk's speed to the side.
      hold: gain of the stance hip against trunk pitch.
      hold_rate: s; likewise, against pitch rate.
      sway: gain of the stance hip against trunk roll.
      sway_rate: s; likewise, against roll rate.
      begin: s; time in which the cycle grows out of the standing pose.
      turn: gain on deviation from the path: the stance hip turns the trunk back, and the swing
        foot lands turned back.
    """

    __pydantic_config__ = STRICT
    step: StaticInterval = (0.0, 1.0)
    step_rate: StaticInterval = (0.0, 1.0)
    side: StaticInterval = (0.0, 1.0)
    side_rate: StaticInterval = (0.0, 1.0)
    hold: StaticInterval = (0.0, 1.0)
    hold_rate: StaticInterval = (0.0, 0.2)
    sway: StaticInterval = (0.0, 1.0)
    sway_rate: StaticInterval = (0.0, 0.2)
    begin: StaticInterval = (0.0, 1.0)
    turn: StaticInterval = (0.0, 0.4)


STEPPING = tuple(field.name for field in dataclasses.fields(SteppingRanges))
"""Names of those genes; genomes hold them after the tuning genes."""


def gene_names(steps: bool) -> tuple[str, ...]:
    """Return the ordered names of a genome's tuning. steps: whether the body steps under a fall."""
    return TUNING + (STEPPING if steps else ())


@dataclasses.dataclass(frozen=True)
class PoseConfig:
    """Settings of the key-pose controller.

    Attributes:
      key_poses: K, poses of half a cycle (of the whole cycle for an unsymmetric creature).
      mirror: whether the other half of a symmetric creature's cycle is the mirror image; else
        the K poses are the whole cycle.
      in_phase: whether each pose of a symmetric creature is its own mirror image, so that left and
        right move together, as in a bound; for `mirror = false`.
      interpolation: n, steps between neighbouring poses.
      steering: factor on the creature's steering weights; turns need more than a straight path.
      advance: the target advances when the pose error is below the threshold, or by the clock.
      around: rad; key poses to search around, pose by pose and joint by joint, as
        `mjxgait refine` sets them; none leaves the whole pose ranges.
      within: deg; largest distance from them.
      tuning: ranges of the tuning genes.
      stepping: ranges of the genes of bodies that step under a fall.
    """

    __pydantic_config__ = STRICT
    key_poses: Annotated[int, pydantic.Field(ge=2), SHAPE] = 2
    mirror: bool = True
    in_phase: Annotated[bool, SHAPE, ADDED] = False
    interpolation: Count = 10
    steering: Annotated[Positive, SHAPE] = 1.0
    advance: Literal["error", "clock"] = "error"
    around: tuple[Finite, ...] = ()
    within: NonNegative = 0.0
    tuning: TuningRanges = dataclasses.field(default_factory=TuningRanges)
    stepping: SteppingRanges = dataclasses.field(default_factory=SteppingRanges)


def unhurried(seconds: float, time_step: float) -> int:
    """Return the steps between poses for a cycle of at least `seconds`; at least the default.

    The target advances at most one step per control step, of `time_step` s.
    """
    plain = PoseConfig()
    return max(round(seconds / time_step / (2 * plain.key_poses)), plain.interpolation)


def smooth(period: float, poses: int, time_step: float) -> int:
    """Return the steps between poses with which a clock moves the target in every control step.

    With fewer the target stands still and jumps, which shakes the feet.
    period: s of the longest cycle. poses: of the whole cycle.
    """
    return max(math.ceil(period / (poses * time_step)), 1)
