"""Criteria shared by the tasks: pure functions from measurements to values, thresholds and results.

Letters: `T` frames, `J` actuated joints.
"""

import dataclasses
from typing import Literal

import numpy as np

from mjxgait.certification.config import CertificateConfig, PartsConfig, PhysicsConfig
from mjxgait.reference.measure import Recording, stride_starts
from mjxgait.reference.outcome import Fall

SHAPELESS = 0.25
"""Largest share of the mass in moving parts without a shape, such as the crosses of hips."""


@dataclasses.dataclass(frozen=True)
class Measure:
    """One number against its threshold.

    sense: `>=` if the value must be at least the threshold, `<=` if at most.
    room: distance from the threshold beyond which the margin no longer grows.
    """

    name: str
    value: float
    sense: Literal[">=", "<="]
    threshold: float
    room: float

    @property
    def passed(self) -> bool:
        """True if the value meets the threshold; NaN never does."""
        return bool(
            self.value >= self.threshold if self.sense == ">=" else self.value <= self.threshold
        )

    @property
    def margin(self) -> float:
        """Distance to the threshold in units of `room`: at most 1, negative if failed."""
        if np.isnan(self.value):
            return -np.inf
        distance = (
            self.value - self.threshold if self.sense == ">=" else self.threshold - self.value
        )
        return (
            float(min(distance / self.room, 1.0)) if self.room else (1.0 if self.passed else -1.0)
        )


@dataclasses.dataclass(frozen=True)
class Criterion:
    """Group of measures that must all pass."""

    number: int
    name: str
    measures: tuple[Measure, ...]

    @property
    def passed(self) -> bool:
        """True if there are measures and all of them pass."""
        return bool(self.measures) and all(m.passed for m in self.measures)

    @property
    def margin(self) -> float:
        """Margin of the worst measure."""
        return min((m.margin for m in self.measures), default=-np.inf)

    @property
    def skill(self) -> str:
        """Skill that it is about, of a body with several, and a space; else empty."""
        skill, colon, _ = self.name.partition(": ")
        return f"{skill} " if colon else ""


def failures(*criteria: Criterion) -> int:
    """Number of measures that do not pass."""
    return sum(not measure.passed for one in criteria for measure in one.measures)


def at_least(name: str, value: float, threshold: float, best: float | None = None) -> Measure:
    """Measure that should be large.

    best: value beyond which more is no better; twice the threshold by default.
    """
    return Measure(
        name, float(value), ">=", threshold, (2 * threshold if best is None else best) - threshold
    )


def steady(name: str, first: float, second: float, least: float) -> Measure:
    """Measure of the second half of a motion over the first."""
    share = second / first if first > 0 else np.nan
    return at_least(name, share, least, 1.0)


def at_most(name: str, value: float, threshold: float) -> Measure:
    """Measure that should be small, at best zero."""
    return Measure(name, float(value), "<=", threshold, threshold)


def upright(whole: Recording, window: Recording, config: Fall) -> Criterion:
    """Criterion 1: no fall; in the window only feet and ground contacts touch the floor."""
    height = whole.trunk_pos[:, 2] / whole.dimensions.stand_height
    low, high = config.height
    return Criterion(
        1,
        "stays up",
        (
            at_least("least upright", whole.trunk_up.min(), config.min_up, 1.0),
            at_least("least height", height.min(), low, 1.0),
            Measure("greatest height", float(height.max()), "<=", high, high - 1.0),
            at_most("time on wrong parts", window.touch.mean(), 0.0),
        ),
    )


def starts(share: float, config: CertificateConfig) -> Criterion:
    """Criterion 4: share of the perturbed starts that stayed up."""
    return Criterion(
        4, "perturbed starts", (at_least("share that stays up", share, config.starts.upright, 1.0),)
    )


def pushes(share: float, config: CertificateConfig) -> Criterion:
    """Criterion 5: share of the pushed simulations that stayed up."""
    return Criterion(
        5, "pushes", (at_least("share that stays up", share, config.pushes.upright, 1.0),)
    )


def physics(window: Recording, config: PhysicsConfig) -> Criterion:
    """Criterion 8 of a body with hips: speed and penetration count in units of its size."""
    size = window.dimensions
    speed = window.body_speed.max() / np.sqrt(size.gravity * size.hip_height)
    depth = window.penetration.max() / size.hip_height
    return machine(
        window,
        config,
        at_most("body speed / sqrt(g h)", speed, config.body_speed),
        at_most("penetration / hip height", depth, config.penetration),
    )


def machine(window: Recording, config: PhysicsConfig, *own: Measure) -> Criterion:
    """Criterion 8: no physics exploit.

    Speeds, joint angles and torques must be those of a machine that could exist. own: measures of
    bodies of this kind.
    """
    fastest, overrun = np.abs(window.joint_vel).max(), joint_overrun(window).max()
    torque = float((np.abs(window.torque) / window.dimensions.torque_limit).max())
    return Criterion(
        8,
        "physics",
        (
            at_most("joint speed (rad/s)", fastest, config.joint_speed),
            at_most("joint past its range (rad)", overrun, config.joint_overrun),
            *own,
            Measure("torque / limit", torque, "<=", config.torque, 0.0),
        ),
    )


def parts(window: Recording, config: PartsConfig) -> Criterion:
    """Criterion 9: no more overlap than in the standing pose, except between neighbours.

    Parts without a shape cannot be examined.
    """
    deepest = window.overlap.max(initial=0.0) / window.dimensions.hip_height
    measures = [at_most("overlap / hip height", deepest, config.overlap)]
    if window.dimensions.shapeless > 0:
        share = window.dimensions.shapeless
        measures.append(at_most("not examined: mass without a shape / mass", share, SHAPELESS))
    return Criterion(9, "parts", tuple(measures))


def joint_overrun(window: Recording) -> np.ndarray:
    """Angle [T, J] in rad past the end of each joint's range; 0 within it.

    The shipped bodies have no stop there; only targets end there.
    """
    low, high = np.array(window.dimensions.joint_range).T
    return np.maximum(np.maximum(low - window.joint_pos, window.joint_pos - high), 0.0)


def speed(window: Recording) -> float:
    """Mean forward speed in m/s."""
    return distance(window) / ((len(window.trunk_pos) - 1) * window.time_step)


def distance(window: Recording) -> float:
    """Forward distance in m."""
    return float(window.trunk_pos[-1, 0] - window.trunk_pos[0, 0])


def ratio(part: float, way: float) -> float:
    """Ratio of a nuisance to the forward distance; NaN without one."""
    return part / way if way > 0 else np.nan


LEFT = 0.05
"""Share of the certificate's minimum speed below which a creature has not left its place."""


def obstacle(whole: Recording, config: CertificateConfig) -> str | None:
    """Return the first reason that a recorded motion is no walk; None if it strides ahead."""
    fell = _fell(whole, config)
    if fell is not None:
        when = "in the first second, " if fell < 1 else ""
        return f"fell {when}after {fell:.1f} s"
    seconds = (len(whole.trunk_pos) - 1) * whole.time_step
    way = distance(whole)
    due = config.progress.speed * whole.dimensions.body_length * seconds
    if abs(way) < LEFT * due:
        return f"never left its place: {way:.2f} m in {seconds:.0f} s"
    if way < 0:
        return f"went backwards, {-way:.2f} m in {seconds:.0f} s"
    if len(stride_starts(whole.window(config.warmup))) < 2:
        return f"went {way:.2f} m without a stride: no foot leaves the floor and comes down again"
    return None


def _fell(whole: Recording, config: CertificateConfig) -> float | None:
    """Time in s until the trunk tips over or is too low or too high; None if it stays up."""
    low, high = config.upright.height
    height = whole.trunk_pos[:, 2] / whole.dimensions.stand_height
    up = (whole.trunk_up >= config.upright.min_up) & (height >= low) & (height <= high)
    return None if up.all() else float(np.argmin(up)) * whole.time_step
