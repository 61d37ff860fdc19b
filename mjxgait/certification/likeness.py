"""How much a walk is like an animal's: dynamic similarity (Alexander & Jayes 1983), and its bearing."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification.criteria import speed
from mjxgait.reference.measure import Recording
from mjxgait.reference.strides import falls_of_feet, stride_frequency
from mjxgait.tasks.walk.gaits import animal_duty, animal_stride


def likeness(window: Recording, clearance: float) -> dict[str, float]:
    """Stride length and duty factor over those of an animal with such legs at this speed; where feet
    stand, in hip heights (`standing`); deg of the nose above the horizon, mean; how often a
    foot loses the floor for a moment in each stride (`patter`), which an animal's does not.

    clearance: height in hip heights that makes a swing.
    """
    hip, v = window.dimensions.hip_height, speed(window)
    stride = v / stride_frequency(window, clearance)
    return {
        "stride": float(stride / animal_stride(v, hip)) if v > 0 else np.nan,
        "duty_factor": float(window.contact.mean() / animal_duty(v, hip)),
        "reach": standing(window),
        "pitch": -float(np.degrees(window.pitch.mean())),
        "patter": patter(window),
    }


def in_words(report: Mapping[str, Any]) -> str | None:
    """A sentence from a report; None where it is of no walk, or of one that gets nowhere."""
    found = report.get("likeness", {})
    stride, duty = found.get("stride"), found.get("duty_factor")
    if stride is None or duty is None or not np.isfinite([stride, duty]).all():
        return None
    told = f"Strides are {stride:.2f} and duty factors {duty:.2f} of an animal's at this speed"
    if (often := found.get("patter") or 0.0) < 0.5:
        return f"{told}."
    return f"{told}; in each of them a foot loses the floor for a moment {often:.1f} times."


def patter(window: Recording) -> float:
    """How often a foot loses the floor for a moment in each stride, mean of the feet: touchdowns that
    end no swing.
    """
    carries = window.contact
    touchdowns = (carries[1:] & ~carries[:-1]).sum(0)
    swung = np.array(list(map(len, falls_of_feet(window))))
    strides = max(np.sort(swung)[len(swung) // 2], 1)
    return float(np.maximum(touchdowns - swung, 0).mean() / strides)


def standing(window: Recording) -> float:
    """Hip heights by which feet are ahead of or behind where they stand at rest, in the mean of all
    moments in which they carry weight; mean of the feet.
    """
    if window.foot_ahead is None:
        return np.nan
    size, carries = window.dimensions, window.contact
    moved = window.foot_ahead - np.array(size.foot_places)[:, 0]
    middles = (moved * carries).sum(0) / np.maximum(carries.sum(0), 1)
    return float(np.abs(middles).mean() / size.hip_height)
