"""Settings of the controllers and of the drive."""

import dataclasses
from typing import Annotated, Literal

import pydantic

from mjxgait.config.tables import (
    SHAPE,
    STRICT,
    Count,
    Finite,
    Interval,
    NonNegative,
    Positive,
)

HOLDS = (1, 2, 4, 8, 16)
"""Control steps from one command to the next that there can be."""


def holds(steps: int) -> int:
    """For how many steps a command stays.

    Raises:
      ValueError: not so many.
    """
    if steps not in HOLDS:
        raise ValueError(f"must be one of {', '.join(map(str, HOLDS))} control steps")
    return steps


@dataclasses.dataclass(frozen=True)
class TuningRanges:
    """Where the controller's own genes may lie (docs/controller.md); equal ends fix one.

    Attributes:
      threshold: rad; pose error, root mean square, below which the target moves on.
      period: s; of the cycle, where the clock moves the target on.
      steer: how strongly turning away from the way is answered.
      pitch: how strongly pitch is answered.
      pitch_rate: s; how strongly its speed is.
      roll: how strongly roll is answered.
      roll_rate: s; how strongly its speed is.
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
    """Where the genes of stepping under the fall may lie, for bodies with weights in `[stepping]`
    (docs/controller.md); all others have no such genes. Equal ends fix one.

    Attributes:
      step: how far ahead the swing leg steps, for how far the trunk is ahead of its support.
      step_rate: likewise, for how fast the trunk goes ahead.
      side: how far to the side, for how far the trunk is beside its support.
      side_rate: likewise, for how fast it goes to the side.
      hold: how strongly the stance leg's hip turns the trunk back that pitches.
      hold_rate: s; likewise, for how fast it pitches.
      sway: how strongly the hip turns the trunk back that rolls.
      sway_rate: s; likewise, for how fast it rolls.
      begin: s; over how long the cycle grows out of the standing pose.
      turn: how strongly the hip turns the trunk back, and the foot that swings, that turn away from
        the way.
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
"""Names of those genes; genomes hold them behind the tuning genes."""


def gene_names(steps: bool) -> tuple[str, ...]:
    """Of a genome's tuning, in its order. steps: whether the body steps under its fall."""
    return TUNING + (STEPPING if steps else ())


@dataclasses.dataclass(frozen=True)
class PoseConfig:
    """The controller of key poses.

    Attributes:
      key_poses: K, poses of half a cycle (of the whole one for an unsymmetric creature).
      mirror: whether the other half of a symmetric creature's cycle is the mirror image; else
        the K poses are the whole cycle.
      interpolation: n, steps between neighbouring poses.
      steering: factor on the creature's weights of steering; turns want more than a straight way.
      advance: the target moves on when the pose error is below the threshold, or by the
        clock.
      around: rad; key poses near which all others lie, pose by pose and joint by joint, as
        `mjxgait refine` finds them; none leaves the whole pose ranges.
      within: deg; how far from them.
      tuning: ranges of the controller's own genes.
      stepping: ranges of the genes of bodies that step under their fall.
    """

    __pydantic_config__ = STRICT
    key_poses: Annotated[int, pydantic.Field(ge=2), SHAPE] = 2
    mirror: bool = True
    interpolation: Count = 10
    steering: Annotated[Positive, SHAPE] = 1.0
    advance: Literal["error", "clock"] = "error"
    around: tuple[Finite, ...] = ()
    within: NonNegative = 0.0
    tuning: TuningRanges = dataclasses.field(default_factory=TuningRanges)
    stepping: SteppingRanges = dataclasses.field(default_factory=SteppingRanges)


def unhurried(seconds: float, time_step: float) -> int:
    """Steps between poses, the usual ones at least, with which no cycle takes less than these s: it
    moves on by a step at most every control step, of `time_step` s.
    """
    plain = PoseConfig()
    return max(round(seconds / time_step / (2 * plain.key_poses)), plain.interpolation)


@dataclasses.dataclass(frozen=True)
class DriveConfig:
    """How the joints' motors follow what a controller sends.

    Attributes:
      law: stable PD, or plain PD for comparison.
      constraint_forces: whether stable PD counts the constraint forces of the previous step,
        as in DART's tutorial.
      stiffness: factor on the creature's kp.
      damping: factor on the creature's kd.
    """

    __pydantic_config__ = STRICT
    law: Literal["spd", "pd"] = "spd"
    constraint_forces: bool = False
    stiffness: Positive = 1.0
    damping: Positive = 1.0
