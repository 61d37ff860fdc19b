"""Thresholds of the certificate with their defaults: a table for each criterion and task.

The table of criterion 1 is `outcome.Fall`; those of tasks are in each task's `thresholds`.
"""

import dataclasses

from mjxgait.config.tables import (
    STRICT,
    Count,
    Fraction,
    NonNegative,
    Positive,
    Whole,
)
from mjxgait.reference.outcome import Fall
from mjxgait.tasks.hop.thresholds import HopThresholds, LimboThresholds, TravelThresholds
from mjxgait.tasks.modular.thresholds import (
    CompeteThresholds,
    FollowThresholds,
    JumpThresholds,
    RoamThresholds,
    SwimThresholds,
)


@dataclasses.dataclass(frozen=True)
class ProgressConfig:
    """Criterion 2: progress.

    Attributes:
      strides: least number. speed: body lengths/s, least. drift: largest, over the distance.
      heading: deg off straight ahead, largest, mean over a second.
      second_half: least speed of the second half over that of the first.
    """

    __pydantic_config__ = STRICT
    strides: Count = 8
    speed: NonNegative = 0.5
    drift: Positive = 0.25
    heading: Positive = 25.0
    second_half: Positive = 0.8


@dataclasses.dataclass(frozen=True)
class PeriodConfig:
    """Criterion 3: periodic strides.

    Attributes:
      autocorrelation: least, at the stride period.
      variation: largest coefficient of variation of the stride period.
    """

    __pydantic_config__ = STRICT
    autocorrelation: Fraction = 0.8
    variation: Positive = 0.1


@dataclasses.dataclass(frozen=True)
class StartsConfig:
    """Criterion 4: perturbed starts.

    Attributes:
      count: starts.
      joints, velocities, masses, gains: half widths in rad, rad/s, and as a share of each body's
        mass and of each joint's kp and kd.
      friction: range of the factor. latency: largest delay of torques in control steps.
      slope: steepest, in degrees. floor: range of the factor on the softness of the floor.
      upright: share that must stay up.
    """

    __pydantic_config__ = STRICT
    count: Count = 64
    joints: NonNegative = 0.05
    velocities: NonNegative = 0.1
    friction: tuple[Positive, Positive] = (0.8, 1.2)
    masses: Fraction = 0.05
    gains: Fraction = 0.1
    latency: Whole = 1
    slope: NonNegative = 1.0
    floor: tuple[Positive, Positive] = (0.25, 4.0)
    upright: Fraction = 0.9


@dataclasses.dataclass(frozen=True)
class PushesConfig:
    """Criterion 5: pushes. Speeds are in units of sqrt(g * hip height).

    Attributes:
      count, speed: pushes and their size. window: s, when a push may come. upright: share that must
        stay up to the end.
      ladder: speeds of larger pushes, to find the one that fells half. ladder_count: pushes at
        each speed. ladder_seconds: s to fall after a push.
    """

    __pydantic_config__ = STRICT
    count: Count = 64
    speed: NonNegative = 0.1
    window: tuple[NonNegative, Positive] = (2.0, 10.0)
    upright: Fraction = 0.8
    ladder: tuple[Positive, ...] = (0.2, 0.3, 0.4, 0.6, 0.8)
    ladder_count: Count = 16
    ladder_seconds: Positive = 5.0


@dataclasses.dataclass(frozen=True)
class HalfStepConfig:
    """Criterion 6: half the time step.

    Attributes:
      distance: largest relative change of the distance.
    """

    __pydantic_config__ = STRICT
    distance: Positive = 0.2


@dataclasses.dataclass(frozen=True)
class GaitConfig:
    """Criterion 7: gait.

    Attributes:
      frequency: largest stride frequency, in units of 4.48 m^-0.14 Hz. stride_length: least, in hip
        heights.
      clearance: least, in hip heights. slip: largest, over the distance. duty_factor: range.
      flicker: largest number of touchdowns per stride that end no swing, mean of the feet.
      buzz: strongest vibration of a joint over the speed of all joints.
      amplitudes: largest difference between amplitudes of a joint and its mirror image, over the
        larger.
      duties: largest difference between the duty factors of a left foot and of the right one.
    """

    __pydantic_config__ = STRICT
    frequency: Positive = 1.2
    stride_length: Positive = 0.5
    clearance: Positive = 0.03
    slip: Positive = 0.15
    duty_factor: tuple[Fraction, Fraction] = (0.15, 0.9)
    flicker: Positive = 5.0
    buzz: Positive = 0.35
    amplitudes: Positive = 0.28
    duties: Positive = 0.1


@dataclasses.dataclass(frozen=True)
class PhysicsConfig:
    """Criterion 8: physics. All values are the largest allowed.

    Attributes:
      joint_speed: rad/s. joint_overrun: rad past the end of a joint's range.
      body_speed: sqrt(g * hip height). penetration: hip heights. torque: torque limits.
    """

    __pydantic_config__ = STRICT
    joint_speed: Positive = 20.0
    joint_overrun: Positive = 0.1
    body_speed: Positive = 3.0
    penetration: Positive = 0.05
    torque: Positive = 1.0


@dataclasses.dataclass(frozen=True)
class PartsConfig:
    """Criterion 9: parts.

    Attributes:
      overlap: hip heights, largest depth of parts in others that are not their neighbours.
    """

    __pydantic_config__ = STRICT
    overlap: Positive = 0.02


@dataclasses.dataclass(frozen=True)
class TargetsConfig:
    """Criteria 10 and 11: tolerances of the walk targets (docs/guide/gaits.md).

    Attributes:
      speed: over the target speed. heading: deg off the commanded heading, mean over a second.
      height: standing heights. bounce: hip heights. sway: deg.
      stride, duty_factor: over an animal's. reach: hip heights. pitch: deg.
      commands: steering simulations, each with a commanded turn: from straight ahead, to either
        side, at a rate not known in advance.
      delay: s from a command until the heading must follow it. obey: share that must follow.
    """

    __pydantic_config__ = STRICT
    speed: Positive = 0.1
    heading: Positive = 15.0
    commands: Count = 32
    delay: NonNegative = 3.0
    obey: Fraction = 0.9
    height: Positive = 0.05
    bounce: Positive = 0.02
    sway: Positive = 2.0
    stride: Positive = 0.25
    duty_factor: Positive = 0.25
    reach: Positive = 0.15
    pitch: Positive = 8.0


@dataclasses.dataclass(frozen=True)
class CertificateConfig:
    """Settings of the examination.

    Attributes:
      seconds: of each simulation. warmup: s at its start that do not count.
      seed: of starts and pushes, together with the champion's fingerprint.
    """

    __pydantic_config__ = STRICT
    seconds: Positive = 22.0
    warmup: NonNegative = 2.0
    seed: Whole = 0
    upright: Fall = dataclasses.field(default_factory=Fall)
    progress: ProgressConfig = dataclasses.field(default_factory=ProgressConfig)
    period: PeriodConfig = dataclasses.field(default_factory=PeriodConfig)
    starts: StartsConfig = dataclasses.field(default_factory=StartsConfig)
    pushes: PushesConfig = dataclasses.field(default_factory=PushesConfig)
    half_step: HalfStepConfig = dataclasses.field(default_factory=HalfStepConfig)
    gait: GaitConfig = dataclasses.field(default_factory=GaitConfig)
    physics: PhysicsConfig = dataclasses.field(default_factory=PhysicsConfig)
    parts: PartsConfig = dataclasses.field(default_factory=PartsConfig)
    wishes: TargetsConfig = dataclasses.field(default_factory=TargetsConfig)
    hop: HopThresholds = dataclasses.field(default_factory=HopThresholds)
    limbo: LimboThresholds = dataclasses.field(default_factory=LimboThresholds)
    travel: TravelThresholds = dataclasses.field(default_factory=TravelThresholds)
    swim: SwimThresholds = dataclasses.field(default_factory=SwimThresholds)
    roam: RoamThresholds = dataclasses.field(default_factory=RoamThresholds)
    jump: JumpThresholds = dataclasses.field(default_factory=JumpThresholds)
    follow: FollowThresholds = dataclasses.field(default_factory=FollowThresholds)
    compete: CompeteThresholds = dataclasses.field(default_factory=CompeteThresholds)

    def __post_init__(self) -> None:
        if self.warmup >= self.seconds:
            raise ValueError(
                f"warmup = {self.warmup}: must be shorter than seconds = {self.seconds}"
            )
