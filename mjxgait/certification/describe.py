"""Description of a gait without thresholds: speed, effort, rhythm, footfalls and name.

Left and right are compared without the times of footfalls: in a canter they fall at different
times. Letters: `F` frequencies, `J` actuated joints, `N` feet.
"""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification.config import GaitConfig
from mjxgait.certification.criteria import Measure, at_most, distance, speed
from mjxgait.reference.measure import (
    Dimensions,
    Recording,
    falls_of_feet,
    stride_frequency,
    stride_starts,
)
from mjxgait.tasks.walk.gaits import animal_duty, animal_stride, stations_of, transition

SLOWEST = 20.0
"""Hz; slower motion may belong to a stride."""
MULTIPLE = 7
"""Multiple of the stride frequency at which an animal changes from trot to gallop.

Small animals stride fast.
"""
BAND = 2.0
"""Hz, width of the search band.

A footfall shakes a joint at all frequencies, a vibration at one.
"""


def buzz(window: Recording) -> float:
    """Return the strongest vibration of a joint over the speed of all joints (root mean squares).

    The vibration is the largest speed of any joint within any band of 2 Hz, from 20 Hz on, or
    from `MULTIPLE` times the transition frequency if that is higher.
    """
    velocity, step = window.joint_vel, window.time_step
    if not np.isfinite(velocity).all() or not velocity.any():
        return np.nan
    power, spacing = _power(velocity), 1 / (len(velocity) * step)
    first = int(np.ceil(max(SLOWEST, MULTIPLE * transition(window.dimensions.mass)) / spacing))
    sums = np.cumsum(np.pad(power, ((1, 0), (0, 0))), axis=0)[first:]
    width = max(round(BAND / spacing), 1)
    bands = sums[width:] - sums[:-width]
    return float(np.sqrt(bands.max(initial=0.0) / (velocity**2).mean(0).mean()))


def vibration(window: Recording, config: GaitConfig) -> Measure:
    """Compare the strongest vibration of a joint with its threshold."""
    return at_most("buzz of a joint / joint speed", buzz(window), config.buzz)


def _power(velocity: np.ndarray) -> np.ndarray:
    """Power [F, J] in (rad/s)² at each frequency from 0 on; its sum is a joint's mean square."""
    taper = np.hanning(len(velocity))[:, None]
    waves: np.ndarray = np.abs(np.fft.rfft(velocity * taper, axis=0)) ** 2
    total = waves.sum(0)
    scale = (velocity**2).mean(0) / np.where(total > 0, total, 1.0)
    return waves * scale


STILL = 0.2
"""Least amplitude to divide by, as a share of the root mean square amplitude of all joints."""


def amplitudes_apart(window: Recording) -> float:
    """Largest difference between amplitudes of a joint and its mirror image, over the larger.

    An amplitude is the standard deviation of the angle. A pair that hardly moves is no limp.
    """
    partner = list(window.dimensions.partner)
    amplitude = window.joint_pos.std(0)
    least = STILL * np.sqrt((amplitude**2).mean())
    larger = np.maximum(np.maximum(amplitude, amplitude[partner]), least)
    apart = np.abs(amplitude - amplitude[partner]) / np.where(larger > 0, larger, 1.0)
    return float(apart.max(initial=0.0))


def duties_apart(window: Recording) -> float:
    """Largest difference between the duty factors of a left foot and the right one beside it."""
    duty = window.contact.mean(0)
    return max((abs(float(duty[a] - duty[b])) for a, b in pairs_of(window)), default=0.0)


def sides(window: Recording) -> dict[str, object] | None:
    """Return the report's entry on left and right; None for a body without two like sides."""
    if not window.dimensions.partner:
        return None
    return {"amplitude": amplitudes_apart(window), "duty_factor": duties_apart(window)}


def pairs_of(window: Recording) -> list[tuple[int, int]]:
    """Pairs of left and right feet beside each other."""
    at = {station: foot for foot, station in enumerate(stations_of(window.dimensions.foot_places))}
    return [(foot, at[rank, False]) for (rank, left), foot in at.items() if left]


def likeness(window: Recording, clearance: float) -> dict[str, float]:
    """Compare a walk with that of an animal with such legs at this speed.

    stride, duty_factor: over the animal's. reach: see `stance_offset`. pitch: mean deg of the nose
    above the horizon. patter: see `patter`; an animal has none.
    clearance: rise of a foot in a swing, in hip heights.
    """
    hip, v = window.dimensions.hip_height, speed(window)
    stride = v / stride_frequency(window, clearance)
    return {
        "stride": float(stride / animal_stride(v, hip)) if v > 0 else np.nan,
        "duty_factor": float(window.contact.mean() / animal_duty(v, hip)),
        "reach": stance_offset(window),
        "pitch": -float(np.degrees(window.pitch.mean())),
        "patter": patter(window),
    }


def in_words(report: Mapping[str, Any]) -> str | None:
    """Return a sentence on a report; None if it is of no walk, or of one without progress."""
    found = report.get("likeness", {})
    stride, duty = found.get("stride"), found.get("duty_factor")
    if stride is None or duty is None or not np.isfinite([stride, duty]).all():
        return None
    sentence = f"Strides are {stride:.2f} and duty factors {duty:.2f} of an animal's at this speed"
    if (often := found.get("patter") or 0.0) < 0.5:
        return f"{sentence}."
    return f"{sentence}; in each of them a foot loses the floor for a moment {often:.1f} times."


def patter(window: Recording) -> float:
    """Contact flicker: touchdowns per stride that end no swing, mean of the feet."""
    carries = window.contact
    touchdowns = (carries[1:] & ~carries[:-1]).sum(0)
    swung = np.array(list(map(len, falls_of_feet(window))))
    strides = max(np.sort(swung)[len(swung) // 2], 1)
    return float(np.maximum(touchdowns - swung, 0).mean() / strides)


def stance_offset(window: Recording) -> float:
    """Mean offset of stance from its place at rest, forward or back, in hip heights.

    Each foot's offset is its mean over all frames in which it carries weight.
    """
    if window.foot_ahead is None:
        return np.nan
    size, carries = window.dimensions, window.contact
    moved = window.foot_ahead - np.array(size.foot_places)[:, 0]
    middles = (moved * carries).sum(0) / np.maximum(carries.sum(0), 1)
    return float(np.abs(middles).mean() / size.hip_height)


def describe(window: Recording, clearance: float) -> dict[str, object]:
    """Return the report's numbers. clearance: rise of a foot in a swing, in hip heights."""
    size = window.dimensions
    v, frequency = speed(window), stride_frequency(window, clearance)
    duty, phases = window.contact.mean(0), footfall_phases(window)
    return {
        "speed": v,
        "speed_body_lengths": v / size.body_length,
        "froude_number": v**2 / (size.gravity * size.hip_height),
        "cost_of_transport": cost_of_transport(window),
        "stride_frequency": frequency,
        "stride_length": v / frequency,
        "duty_factor": dict(zip(size.foot_names, map(float, duty), strict=True)),
        "footfall_phase": dict(zip(size.foot_names, map(float, phases), strict=True)),
        "footfall_diagram": dict(zip(size.foot_names, footfall_diagram(window), strict=True)),
        "slip": dict(zip(size.foot_names, map(float, slip_distance(window)), strict=True)),
        "gait": gait_name(size, duty, phases),
        "likeness": likeness(window, clearance),
        "overlap": worst_overlap(window),
    }


def slip_distance(window: Recording) -> np.ndarray:
    """Path [N] in m that each foot slides on the floor while it carries weight."""
    return (window.foot_slip * window.contact).sum(0) * window.time_step


def worst_overlap(window: Recording) -> dict[str, object] | None:
    """Two parts with the deepest overlap: depth in m, and share of frames; None without overlap."""
    depth = np.nan_to_num(window.overlap)
    if not depth.any():
        return None
    worst = int(depth.max(0).argmax())
    return {
        "parts": list(window.overlap_pairs[worst]),
        "depth": float(depth[:, worst].max()),
        "share": float((depth[:, worst] > 0).mean()),
    }


def cost_of_transport(window: Recording) -> float:
    """Positive mechanical work of the joints per weight and distance."""
    size = window.dimensions
    # A torque acts from one frame to the next, so it works against the mean of their speeds.
    mean_vel = (window.joint_vel[:-1] + window.joint_vel[1:]) / 2
    work = np.maximum(window.torque[:-1] * mean_vel, 0).sum() * window.time_step
    way = distance(window)
    return float(work / (size.mass * size.gravity * way)) if way > 0 else np.nan


def mean_stance(window: Recording, parts: int) -> np.ndarray:
    """Share of time [parts, N] that each foot carries weight in each part of all strides."""
    starts = stride_starts(window)
    share, seen = np.zeros((parts, window.contact.shape[1])), np.zeros((parts, 1))
    for a, b in itertools.pairwise(starts):
        part = (np.arange(b - a) * parts) // (b - a)
        np.add.at(share, part, window.contact[a:b])
        np.add.at(seen, part, 1)
    return share / np.maximum(seen, 1)


PARTS = 20
"""Parts of a stride in a footfall diagram."""


def footfall_diagram(window: Recording) -> list[str]:
    """Return a string per foot, with a character for each part of the stride.

    `#`: mostly standing. `.`: mostly swinging.
    """
    return ["".join("#" if s > 0.5 else "." for s in foot) for foot in mean_stance(window, PARTS).T]


def footfall_phases(window: Recording) -> np.ndarray:
    """Middle of each foot's stance [N] in cycles, [0, 1), relative to the first foot.

    This circular mean does not depend on a single early or late contact, as a touchdown does. If
    the duty factors are alike, both agree.
    """
    stance = mean_stance(window, 100)
    angle = np.exp(2j * np.pi * (np.arange(len(stance)) + 0.5) / len(stance))
    centre = np.angle((stance * angle[:, None]).sum(0)) / (2 * np.pi)
    return (centre - centre[0]) % 1.0


def gait_name(size: Dimensions, duty: np.ndarray, phases: np.ndarray) -> str:
    """Return the nearest named gait from duty factors and phases [N].

    Hildebrand 1965 for four feet.
    """
    if not np.isfinite(phases).all() or duty.min() > 0.98 or duty.max() < 0.02:
        return "none"
    if size.crawler:
        return "crawl"
    places = np.array(size.foot_places)
    walking = duty.mean() >= 0.5
    match len(duty):
        case 2:
            return _biped(phases, walking)
        case 4:
            return _quadruped(places, duty, phases)
        case n if n >= 6 and n % 2 == 0:
            return _many_legs(places, duty, phases)
        case _:
            return "walk" if walking else "run"


def _apart(a: float, b: float) -> float:
    """Distance between two phases, 0 to 0.5."""
    return abs((a - b + 0.5) % 1.0 - 0.5)


def _biped(phases: np.ndarray, walking: bool) -> str:
    if _apart(phases[0], phases[1]) < 0.2:
        return "hop"
    return "walk" if walking else "run"


def _quadruped(places: np.ndarray, duty: np.ndarray, phases: np.ndarray) -> str:
    order = np.argsort(-places[:, 0])
    front, hind = (
        sorted(order[:2], key=lambda n: -places[n, 1]),
        sorted(order[2:], key=lambda n: -places[n, 1]),
    )
    fl, fr, hl, hr = (float(phases[n]) for n in (*front, *hind))
    front_pair, hind_pair = _apart(fl, fr), _apart(hl, hr)
    if max(front_pair, hind_pair) < 0.15:
        return "pronk" if _apart(fl, hl) < 0.15 else "bound"
    if _three_beats(fl, fr, hl, hr):
        return "canter"
    if min(front_pair, hind_pair) < 0.35:
        return "gallop" if duty.mean() < 0.5 else "walk"
    # Symmetrical gaits: lag of a fore foot behind the hind foot of its side.
    lag = (
        float(
            np.angle(np.exp(2j * np.pi * (fl - hl)) + np.exp(2j * np.pi * (fr - hr))) / (2 * np.pi)
        )
        % 1.0
    )
    if _apart(lag, 0.5) < 0.125:
        return "trot"
    if _apart(lag, 0.0) < 0.125:
        return "pace"
    if duty.mean() >= 0.75:
        return "crawl"
    return "walk" if duty.mean() >= 0.5 else "running walk"


def _three_beats(fl: float, fr: float, hl: float, hr: float) -> bool:
    """Return True if one diagonal's feet fall together, and the others apart from all the rest."""
    for together, others in (((fl, hr), (fr, hl)), ((fr, hl), (fl, hr))):
        beats = (together[0], *others)
        gaps = [_apart(a, b) for a, b in itertools.combinations(beats, 2)]
        if _apart(*together) < 0.1 and min(gaps) > 0.2:
            return True
    return False


def _many_legs(places: np.ndarray, duty: np.ndarray, phases: np.ndarray) -> str:
    sides = [
        sorted(np.flatnonzero(side), key=lambda n: -places[n, 0])
        for side in (places[:, 1] > 0, places[:, 1] <= 0)
    ]
    if len(sides[0]) != len(sides[1]):
        return "walk"
    turn = np.array(
        [
            [(rank + side) % 2 * 0.5, phases[n]]
            for side, feet in enumerate(sides)
            for rank, n in enumerate(feet)
        ]
    )
    together = abs(np.exp(2j * np.pi * (turn[:, 1] - turn[:, 0])).mean())
    if together > 0.8:
        return "tripod" if len(duty) == 6 else "alternating"
    return "wave" if duty.mean() >= 0.75 else "metachronal" if duty.mean() >= 0.5 else "run"
