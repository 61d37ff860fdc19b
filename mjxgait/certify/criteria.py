"""The criteria of the certificate: pure functions from what was measured to values, thresholds and
verdicts.

Letters: `T` frames, `N` feet.
"""

import dataclasses
from typing import Literal

import numpy as np

from mjxgait.certify.config import (
    CertificateConfig,
    GaitConfig,
    PartsConfig,
    PeriodConfig,
    PhysicsConfig,
    ProgressConfig,
)
from mjxgait.certify.measure import Recording
from mjxgait.certify.simulate import Fall
from mjxgait.certify.strides import clearances, stride_frequency, stride_starts


@dataclasses.dataclass(frozen=True)
class Measure:
    """One number against its threshold.

    sense: whether the value must be at least or at most the threshold.
    room: distance from the threshold at which nothing is left to gain.
    """

    name: str
    value: float
    sense: Literal[">=", "<="]
    threshold: float
    room: float

    @property
    def passed(self) -> bool:
        """NaN never passes."""
        return bool(
            self.value >= self.threshold if self.sense == ">=" else self.value <= self.threshold
        )

    @property
    def margin(self) -> float:
        """Distance to the threshold in units of `room`: 1 at best, negative when failed."""
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
    """A group of measures that must all pass."""

    number: int
    name: str
    measures: tuple[Measure, ...]

    @property
    def passed(self) -> bool:
        """Whether all measures pass."""
        return all(m.passed for m in self.measures)

    @property
    def margin(self) -> float:
        """That of the worst measure."""
        return min(m.margin for m in self.measures)


def at_least(name: str, value: float, threshold: float, best: float | None = None) -> Measure:
    """A measure that should be large; `best` is the value beyond which more is no better (twice
    the threshold if not given).
    """
    return Measure(
        name, float(value), ">=", threshold, (2 * threshold if best is None else best) - threshold
    )


def at_most(name: str, value: float, threshold: float) -> Measure:
    """A measure that should be small, at best zero."""
    return Measure(name, float(value), "<=", threshold, threshold)


def upright(whole: Recording, window: Recording, config: Fall) -> Criterion:
    """1. Never falls, and in the window nothing but feet and ground contacts touches the floor."""
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


def progress(window: Recording, config: ProgressConfig) -> Criterion:
    """2. Strides that all lead forward, fast enough, straight, without fading."""
    path, starts = window.trunk_pos, stride_starts(window)
    distance, middle = path[-1, 0] - path[0, 0], len(path) // 2
    first, second = path[middle, 0] - path[0, 0], path[-1, 0] - path[middle, 0]
    advance = np.diff(path[starts, 0]) if len(starts) > 1 else np.array([np.nan])
    sideways = np.abs(path[:, 1] - path[0, 1]).max()
    return Criterion(
        2,
        "progress",
        (
            at_least("strides", len(starts) - 1, config.strides),
            at_least(
                "shortest stride / mean stride", advance.min() / abs(advance.mean()), 0.0, 0.5
            ),
            at_least(
                "speed (body lengths/s)",
                speed(window) / window.dimensions.body_length,
                config.speed,
            ),
            at_most("drift / distance", _ratio(sideways, distance), config.drift),
            at_least(
                "second half / first half",
                second / first if first > 0 else np.nan,
                config.second_half,
                1.0,
            ),
        ),
    )


def periodic(window: Recording, config: PeriodConfig) -> Criterion:
    """3. Joints and trunk attitude repeat with the stride period, and that period is steady."""
    periods = np.diff(stride_starts(window)).astype(float)
    if len(periods) < 2:
        peak = variation = np.nan
    else:
        signal = np.column_stack([window.joint_pos, window.pitch, window.roll])
        peak, variation = (
            autocorrelation_peak(signal, periods.mean()),
            periods.std() / periods.mean(),
        )
    return Criterion(
        3,
        "periodic",
        (
            at_least("autocorrelation at stride period", peak, config.autocorrelation, 1.0),
            at_most("variation of stride period", variation, config.variation),
        ),
    )


def autocorrelation_peak(signal: np.ndarray, period: float) -> float:
    """Largest correlation of the signal [T, D] with itself, shifted by 0.8 to 1.2 periods
    (frames).
    """
    # Without what changes slower than a stride: a wandering signal resembles itself at any shift.
    width = round(period)
    sums = np.cumsum(np.pad(signal, ((1, 0), (0, 0))), axis=0)
    signal = (
        signal[width // 2 :][: len(signal) - width + 1] - (sums[width:] - sums[:-width]) / width
    )

    def correlation(lag: int) -> float:
        early, late = signal[:-lag], signal[lag:]
        norm = np.sqrt((early**2).sum() * (late**2).sum())
        return float((early * late).sum() / norm) if norm > 0 else np.nan

    lags = range(max(1, int(0.8 * period)), min(int(np.ceil(1.2 * period)) + 1, len(signal) // 2))
    return max((correlation(lag) for lag in lags), default=np.nan)


def starts(share: float, config: CertificateConfig) -> Criterion:
    """4. Share of the perturbed starts that stayed up."""
    return Criterion(
        4, "perturbed starts", (at_least("share that stays up", share, config.starts.upright, 1.0),)
    )


def pushes(share: float, config: CertificateConfig) -> Criterion:
    """5. Share of the pushed simulations that stayed up."""
    return Criterion(
        5, "pushes", (at_least("share that stays up", share, config.pushes.upright, 1.0),)
    )


def half_step(whole: Recording, halved: Recording, config: CertificateConfig) -> Criterion:
    """6. With half the time step it still passes 1 to 3 and goes as far."""
    window = whole.window(config.warmup)
    repeated = basic(halved, config)
    change = _distance(halved.window(config.warmup)) / _distance(window) - 1
    failed = sum(not m.passed for c in repeated for m in c.measures)
    return Criterion(
        6,
        "half the time step",
        (
            at_most("failures in criteria 1 to 3", failed, 0.0),
            at_most("change of distance", abs(change), config.half_step.distance),
        ),
    )


def basic(whole: Recording, config: CertificateConfig) -> tuple[Criterion, Criterion, Criterion]:
    """Criteria 1 to 3 of one recording."""
    window = whole.window(config.warmup)
    return (
        upright(whole, window, config.upright),
        progress(window, config.progress),
        periodic(window, config.period),
    )


def gait(window: Recording, config: GaitConfig) -> Criterion:
    """7. A gait, not a buzz: slow, long strides; feet that leave the floor and do not slide on
    it.
    """
    size = window.dimensions
    frequency = stride_frequency(window, config.clearance)
    duty = window.contact.mean(0)
    low, high = config.duty_factor
    return Criterion(
        7,
        "gait",
        (
            at_most(
                "stride frequency / animal's",
                frequency / (4.48 * size.mass**-0.14),
                config.frequency,
            ),
            at_least(
                "stride length / hip height",
                speed(window) / frequency / size.hip_height,
                config.stride_length,
            ),
            at_least(
                "least clearance / hip height",
                clearances(window).min(initial=np.inf) / size.hip_height,
                config.clearance,
            ),
            at_most(
                "worst foot's slip / distance",
                _ratio(slip_distance(window).max(), _distance(window)),
                config.slip,
            ),
            at_least("least duty factor", duty.min(), low),
            Measure("greatest duty factor", float(duty.max()), "<=", high, 1 - high),
        ),
    )


def slip_distance(window: Recording) -> np.ndarray:
    """[N] m, path that each foot slides on the floor while it carries weight."""
    return (window.foot_slip * window.contact).sum(0) * window.time_step


def physics(window: Recording, config: PhysicsConfig) -> Criterion:
    """8. No physics exploit: speeds, joint angles, penetration and torques of a machine that
    could exist.
    """
    size = window.dimensions
    return Criterion(
        8,
        "physics",
        (
            at_most("joint speed (rad/s)", np.abs(window.joint_vel).max(), config.joint_speed),
            at_most(
                "joint past its range (rad)", joint_overrun(window).max(), config.joint_overrun
            ),
            at_most(
                "body speed / sqrt(g h)",
                window.body_speed.max() / np.sqrt(size.gravity * size.hip_height),
                config.body_speed,
            ),
            at_most(
                "penetration / hip height",
                window.penetration.max() / size.hip_height,
                config.penetration,
            ),
            Measure(
                "torque / limit",
                float((np.abs(window.torque) / size.torque_limit).max()),
                "<=",
                config.torque,
                0.0,
            ),
        ),
    )


def parts(window: Recording, config: PartsConfig) -> Criterion:
    """9. No part stands in another but its neighbours, more than in the standing pose."""
    deepest = window.overlap.max(initial=0.0) / window.dimensions.hip_height
    return Criterion(9, "parts", (at_most("overlap / hip height", deepest, config.overlap),))


def joint_overrun(window: Recording) -> np.ndarray:
    """[T, J] rad past the end of each joint's range; 0 within it.

    The shipped bodies have no stop there, only targets end there.
    """
    low, high = np.array(window.dimensions.joint_range).T
    return np.maximum(np.maximum(low - window.joint_pos, window.joint_pos - high), 0.0)


def speed(window: Recording) -> float:
    """Mean forward speed in m/s."""
    return _distance(window) / ((len(window.trunk_pos) - 1) * window.time_step)


def _distance(window: Recording) -> float:
    return float(window.trunk_pos[-1, 0] - window.trunk_pos[0, 0])


def _ratio(part: float, distance: float) -> float:
    """Of a nuisance to the distance; not a number where there is no way forward to compare it
    with.
    """
    return part / distance if distance > 0 else np.nan
