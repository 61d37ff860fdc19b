"""Likeness of a walk to an animal's: dynamic similarity (Alexander & Jayes 1983), and posture."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification.criteria import speed
from mjxgait.reference.measure import Recording
from mjxgait.reference.strides import falls_of_feet, stride_frequency
from mjxgait.tasks.walk.gaits import animal_duty, animal_stride


def likeness(window: Recording, clearance: float) -> dict[str, float]:
    """Compare a walk with that of an animal with such legs at this speed.

    stride, duty_factor: over the animal's. reach: see `standing`. pitch: mean deg of the nose above
    the horizon. patter: see `patter`; an animal has none.
    clearance: rise of a foot in a swing, in hip heights.
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
    """Return a sentence on a report; None if it is of no walk, or of one without progress."""
    found = report.get("likeness", {})
    stride, duty = found.get("stride"), found.get("duty_factor")
    if stride is None or duty is None or not np.isfinite([stride, duty]).all():
        return None
    told = f"Strides are {stride:.2f} and duty factors {duty:.2f} of an animal's at this speed"
    if (often := found.get("patter") or 0.0) < 0.5:
        return f"{told}."
    return f"{told}; in each of them a foot loses the floor for a moment {often:.1f} times."


def patter(window: Recording) -> float:
    """Contact flicker: touchdowns per stride that end no swing, mean of the feet."""
    carries = window.contact
    touchdowns = (carries[1:] & ~carries[:-1]).sum(0)
    swung = np.array(list(map(len, falls_of_feet(window))))
    strides = max(np.sort(swung)[len(swung) // 2], 1)
    return float(np.maximum(touchdowns - swung, 0).mean() / strides)


def standing(window: Recording) -> float:
    """Mean offset of stance from its place at rest, forward or back, in hip heights.

    Each foot's offset is its mean over all frames in which it carries weight.
    """
    if window.foot_ahead is None:
        return np.nan
    size, carries = window.dimensions, window.contact
    moved = window.foot_ahead - np.array(size.foot_places)[:, 0]
    middles = (moved * carries).sum(0) / np.maximum(carries.sum(0), 1)
    return float(np.abs(middles).mean() / size.hip_height)
