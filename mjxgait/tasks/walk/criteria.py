"""Acceptance criteria of a walk.

Letters: `T` frames, `N` feet.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
from typing_extensions import override

from mjxgait.certification.acceptance import Commands, StaysUp, Wish, to_the_end
from mjxgait.certification.config import (
    CertificateConfig,
    GaitConfig,
    PeriodConfig,
    ProgressConfig,
)
from mjxgait.certification.criteria import (
    Criterion,
    Measure,
    at_least,
    at_most,
    distance,
    failures,
    obstacle,
    parts,
    physics,
    ratio,
    speed,
    steady,
    upright,
)
from mjxgait.certification.describe import (
    amplitudes_apart,
    describe,
    duties_apart,
    patter,
    sides,
    slip_distance,
    vibration,
)
from mjxgait.creature import Creature
from mjxgait.reference.measure import (
    Dimensions,
    Recording,
    clearances,
    stride_frequency,
    stride_starts,
)
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.tasks.walk.gaits import gait_of, transition
from mjxgait.tasks.walk.target_criteria import (
    commanded_heading,
    draw_commands,
    following,
    heading_off,
    posture,
    steered,
    targets_met,
    unrolled,
)

SPARE = 1.2
"""Factor over the certificate's minimum speed at which a gait in evolution is worth validating."""

STEERED_FOR = 12.0
"""s, length of a steered simulation."""

STARTED = (0.75, 1.15)
"""Range of the distance in evolution, over that at the target speed, that is worth validating.

The range allows for standing at the start.
"""


class WalkCriteria(StaysUp):
    """Implementation of `AcceptanceCriteria`: steady forward strides, like those of an animal."""

    verdict = "it walks"
    revision = 2
    """1: criteria for flicker, buzz, tilt, heading and limping. 2: a part without mass is measured
    where it is, not where MuJoCo puts its centre of mass.
    """

    def __init__(self, wish: Wish | None = None) -> None:
        self.wish = dict(wish or {})

    @override
    def with_targets(self, wish: Wish) -> "WalkCriteria":
        return WalkCriteria(wish) if wish else self

    @override
    def commanded_heading(self, steps: int, time_step: float) -> np.ndarray | None:
        return commanded_heading(self.wish, steps, time_step)

    @override
    def commands(
        self, config: CertificateConfig, time_step: float, rng: np.random.Generator
    ) -> Commands | None:
        if "steer" not in self.wish:
            return None
        steps, count = round(STEERED_FOR / time_step), config.wishes.commands
        heading = draw_commands(self.wish["steer"], count, steps, time_step, rng)
        return Commands(STEERED_FOR, heading)

    def obeyed(
        self, outcome: Outcome, commands: Commands, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criterion 11."""
        assert commands.heading is not None
        return (steered(outcome, commands.heading, config.wishes),)

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate all criteria but 4 and 5, and 10 if targets are set."""
        config = following(config, self.wish, whole.dimensions)
        whole, halved = (unrolled(recording, self.wish) for recording in (whole, halved))
        window = whole.window(config.warmup)
        targets = (targets_met(window, self.wish, config),) if self.wish else ()
        return (
            *basic(whole, config),
            half_step(whole, halved, config),
            gait(window, config.gait, self.wish),
            physics(window, config.physics),
            parts(window, config.parts),
            *targets,
        )

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        """See `AcceptanceCriteria`."""
        whole = unrolled(whole, self.wish)
        window = whole.window(config.warmup)
        described = describe(window, config.gait.clearance) | {"sides": sides(window)}
        if self.wish:
            described |= {"asked": self.wish, "posture": posture(window)}
        found = {"obstacle": obstacle(whole, config)}
        return described | found | {"summary": f"{described['gait']}, {described['speed']:.2f} m/s"}

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """No early end, and clearly faster than required, or near a target speed."""
        lived = to_the_end(outcome, seconds, creature)
        if "speed" in self.wish:
            came = outcome["forward"] / seconds / self.wish["speed"]
            return lived & (came > STARTED[0]) & (came < STARTED[1])
        wanted = SPARE * CertificateConfig().progress.speed * seconds * creature.frame.body_length
        return lived & (outcome["forward"] >= wanted)


def basic(whole: Recording, config: CertificateConfig) -> tuple[Criterion, Criterion, Criterion]:
    """Criteria 1 to 3 of one recording."""
    window = whole.window(config.warmup)
    stays = upright(whole, window, config.upright)
    return (
        dataclasses.replace(stays, measures=(*stays.measures, lean(window, config.upright))),
        progress(window, config.progress),
        periodic(window, config.period),
    )


def lean(window: Recording, config: Fall) -> Measure:
    """Trunk lean beyond that of standing, part of criterion 1."""
    most = np.degrees(np.arccos(np.clip(window.trunk_up.min(), -1, 1)))
    return at_most("tilt beyond standing (deg)", most - window.dimensions.stand_tilt, config.tilt)


def progress(window: Recording, config: ProgressConfig) -> Criterion:
    """2. All strides lead forward, fast enough, straight, without slowing down."""
    path, starts = window.trunk_pos, stride_starts(window)
    middle = len(path) // 2
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
            at_most("drift / distance", ratio(sideways, distance(window)), config.drift),
            at_most("off straight ahead (deg)", heading_off(window), config.heading),
            steady("second half / first half", first, second, config.second_half),
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
    """Largest autocorrelation of the signal [T, D] at lags of 0.8 to 1.2 periods, in frames."""
    # Remove what changes slower than a stride: a drifting signal resembles itself at any lag.
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


def half_step(whole: Recording, halved: Recording, config: CertificateConfig) -> Criterion:
    """6. With half the time step the walk still passes 1 to 3 and goes as far."""
    window = whole.window(config.warmup)
    change = distance(halved.window(config.warmup)) / distance(window) - 1
    failed = failures(*basic(halved, config))
    return Criterion(
        6,
        "half the time step",
        (
            at_most("failures in criteria 1 to 3", failed, 0.0),
            at_most("change of distance", abs(change), config.half_step.distance),
        ),
    )


def gait(window: Recording, config: GaitConfig, wish: Wish | None = None) -> Criterion:
    """7. A gait, not a vibration: slow, long strides; feet lift and do not slide; sides alike."""
    return Criterion(7, "gait", (*_strides(window, config), *_manner(window, config, wish or {})))


def _manner(window: Recording, config: GaitConfig, wish: Wish) -> tuple[Measure, ...]:
    """Measures of criterion 7 that detect vibration and a limp."""
    measures = (
        at_most("flicker of a foot per stride", patter(window), config.flicker),
        vibration(window, config),
    )
    if not two_like_sides(wish, window.dimensions):
        return measures
    return (
        *measures,
        at_most("left and right amplitudes", amplitudes_apart(window), config.amplitudes),
        at_most("left and right duty factors", duties_apart(window), config.duties),
    )


def two_like_sides(wish: Wish, size: Dimensions) -> bool:
    """Return whether left and right should move alike.

    They need not on a circle, nor in a target gait that leads with one side.
    """
    leads = "gait" in wish and not gait_of(wish["gait"], len(size.foot_names)).twice
    return bool(size.partner) and not wish.get("turn") and not leads


def _strides(window: Recording, config: GaitConfig) -> tuple[Measure, ...]:
    """Measures of criterion 7 on strides and feet."""
    size = window.dimensions
    frequency = stride_frequency(window, config.clearance)
    duty = window.contact.mean(0)
    low, high = config.duty_factor
    return (
        at_most("stride frequency / animal's", frequency / transition(size.mass), config.frequency),
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
            ratio(slip_distance(window).max(), distance(window)),
            config.slip,
        ),
        at_least("least duty factor", duty.min(), low),
        Measure("greatest duty factor", float(duty.max()), "<=", high, 1 - high),
    )
