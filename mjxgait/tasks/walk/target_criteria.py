"""Acceptance criteria for walk targets: speed, gait, turn and posture.

Letters: `T` frames.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from mjxgait.certification.acceptance import Wish
from mjxgait.certification.config import CertificateConfig, TargetsConfig
from mjxgait.certification.criteria import (
    Criterion,
    Measure,
    at_least,
    at_most,
    speed,
)
from mjxgait.certification.describe import footfall_phases, gait_name, likeness
from mjxgait.reference.measure import Dimensions, Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.tasks.walk.gaits import SHORTEST, animal_stride, gait_of

ASKED, BOUNDS = "as asked", ("gait", "physics")
"""Names of criteria: the one for targets, and those that bound what a body can do."""
COMMANDED = (2.0, 4.0)
"""Range of the time of a command, in s."""
FAST_ENOUGH = 0.75
"""Minimum speed as a share of the target speed.

A minimum only the tolerated tenth below the target would leave a walk at exactly the target speed
almost no margin.
"""
HEADING_MEAN = 1.0
"""Averaging time in s: the nose swings within a stride."""


def commanded_heading(wish: Wish, steps: int, time_step: float) -> np.ndarray | None:
    """Commanded heading [T] in rad; None without a turn target."""
    if not {"turn", "steer"} & set(wish):
        return None
    return np.radians(wish.get("turn", 0.0)) * time_step * np.arange(steps)


def draw_commands(
    fastest: float, count: int, steps: int, time_step: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw commanded headings [S, T] in rad: straight at first, then a turn at a constant rate.

    Sides alternate. Each rate is drawn between half of `fastest` and `fastest`, in deg/s.
    """
    rate = fastest * rng.uniform(0.5, 1.0, count) * np.where(np.arange(count) % 2, -1.0, 1.0)
    begin = rng.uniform(*COMMANDED, count)
    since = np.maximum(time_step * np.arange(steps) - begin[:, None], 0.0)
    commanded: np.ndarray = np.radians(rate)[:, None] * since
    return commanded


def steered(outcome: Outcome, commanded: np.ndarray, limits: TargetsConfig) -> Criterion:
    """11. The walk stays up and, some time after each command, keeps the commanded heading.

    commanded: [S, T] rad.
    """
    step = outcome.trajectory.time_step
    width, begins = max(round(HEADING_MEAN / step), 1), (commanded != 0).argmax(1)
    sums = np.cumsum(np.pad(outcome.astray, ((0, 0), (1, 0))), axis=1)
    off = np.degrees(np.abs(sums[:, width:] - sums[:, :-width]) / width)
    due = np.arange(off.shape[1]) >= (begins + round(limits.delay / step))[:, None]
    # NaN, from a fall on, does not count as obeying.
    obeys = outcome.stayed_up & (~due | (off <= limits.heading)).all(1)
    share = at_least("share that obeys", obeys.mean(), limits.obey, 1.0)
    return Criterion(11, "steered", (share,))


def following(config: CertificateConfig, wish: Wish, size: Dimensions) -> CertificateConfig:
    """Return the thresholds adapted to the target speed and pitch.

    The minimum speed is at most `FAST_ENOUGH` of the target, which has a two-sided criterion of its
    own. The minimum stride is at most half of an animal's at that speed, because a slow walk has
    short strides. A target pitch raises the tilt limit by the same angle.
    """
    if "pitch" in wish:
        tilt = config.upright.tilt + abs(wish["pitch"])
        config = dataclasses.replace(config, upright=dataclasses.replace(config.upright, tilt=tilt))
    if "speed" not in wish:
        return config
    requested = wish["speed"]
    slowest = FAST_ENOUGH * requested / size.body_length
    stride = SHORTEST * animal_stride(requested, size.hip_height) / size.hip_height
    return dataclasses.replace(
        config,
        progress=dataclasses.replace(
            config.progress, speed=float(min(config.progress.speed, slowest))
        ),
        gait=dataclasses.replace(
            config.gait, stride_length=float(min(config.gait.stride_length, stride))
        ),
    )


def unrolled(recording: Recording, wish: Wish) -> Recording:
    """Return the recording as if the commanded heading had been straight ahead.

    Each step of the path is turned back by the heading commanded at that time.
    """
    commanded = commanded_heading(wish, len(recording.trunk_pos), recording.time_step)
    if commanded is None:
        return recording
    x, y = np.diff(recording.trunk_pos[:, :2], axis=0, prepend=recording.trunk_pos[:1, :2]).T
    ahead, left = np.cos(commanded), np.sin(commanded)
    way = np.stack([x * ahead + y * left, y * ahead - x * left, 0 * x], 1).cumsum(0)
    place = way + recording.trunk_pos * [0, 0, 1]
    heading = None if recording.heading is None else recording.heading - commanded
    return dataclasses.replace(recording, trunk_pos=place, heading=heading)


def targets_met(window: Recording, wish: Wish, config: CertificateConfig) -> Criterion:
    """10. The walk meets its targets. window: unrolled, after the warm-up."""
    limits = config.wishes
    found = posture(window) | likeness(window, config.gait.clearance)
    measures: list[Measure] = []
    if "speed" in wish:
        off = abs(speed(window) / wish["speed"] - 1)
        measures.append(at_most(f"off the speed of {wish['speed']:.3g} m/s", off, limits.speed))
    if "gait" in wish:
        size, duty = window.dimensions, window.contact.mean(0)
        labels = gait_of(wish["gait"], len(duty)).labels
        name = gait_name(size, duty, footfall_phases(window))
        measures.append(
            Measure(f"footfalls of a {wish['gait']}", float(name in labels), ">=", 1.0, 0.0)
        )
    if {"turn", "steer"} & set(wish):
        measures.append(
            at_most("off the commanded heading (deg)", heading_off(window), limits.heading)
        )
    for name in found:
        if name in wish:
            off = abs(found[name] - wish[name])
            measures.append(
                at_most(f"off the {name} of {wish[name]:.3g}", off, getattr(limits, name))
            )
    return Criterion(10, ASKED, tuple(measures))


def in_the_way(criteria: Sequence[Criterion]) -> str | None:
    """Sentence on the first missed target and the number in its way; None if none was missed.

    The number is the measure of gait or physics nearest to its limit, or farthest beyond.
    """
    missed = [m for c in criteria if c.name == ASKED for m in c.measures if not m.passed]
    bounds = [m for c in criteria if c.name in BOUNDS for m in c.measures if m.room]
    if not missed or not bounds:
        return None
    first, nearest = missed[0], min(bounds, key=lambda m: m.margin)
    return (
        f"{first.name}: {first.value:.3g}; the limit is {first.threshold:g}. The tightest other "
        f"measure is {nearest.name}: {nearest.value:.3g}; its limit is {nearest.sense} "
        f"{nearest.threshold:.3g}."
    )


def heading_off(window: Recording) -> float:
    """Largest deviation from the commanded heading in deg, mean over a second."""
    if window.heading is None:
        return np.nan
    width = max(round(HEADING_MEAN / window.time_step), 1)
    mean = np.convolve(window.heading, np.full(width, 1 / width), "valid")
    return float(np.degrees(np.abs(mean).max()))


def posture(window: Recording) -> dict[str, float]:
    """Trunk posture: height in standing heights, bounce in hip heights, sway in deg."""
    height, size = window.trunk_pos[:, 2], window.dimensions
    return {
        "height": float(height.mean() / size.stand_height),
        "bounce": float(height.std() / size.hip_height),
        "sway": float(np.degrees(np.sqrt((window.roll**2).mean()))),
    }
