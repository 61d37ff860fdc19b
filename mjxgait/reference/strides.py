"""Swings, footfalls and strides, from the heights of the feet alone, for any controller.

Letters: `T` frames, `N` feet, `R` strides.
"""

import itertools

import numpy as np

from mjxgait.reference.measure import Recording

SWING = 0.03
"""Rise of a foot in a swing, in hip heights; the swing ends at half of it."""


def stride_starts(recording: Recording) -> np.ndarray:
    """Return the frames [R + 1] at which strides begin: one foot's footfalls; empty without a walk.

    That foot lands most evenly of those that swing at least as often as the median foot. A foot
    that trembles or scuffs in some strides does not mark strides.
    """
    falls = falls_of_feet(recording)
    usual = sorted(map(len, falls))[(len(falls) - 1) // 2]
    often = [foot for foot in falls if len(foot) >= max(usual, 2)]
    return min(often, key=_unevenness, default=np.zeros(0, dtype=int))


def falls_of_feet(recording: Recording) -> list[np.ndarray]:
    """Return the frames at which each foot [N] has come down from a swing."""
    threshold = SWING * recording.dimensions.hip_height
    return [footfalls(height, threshold) for height in recording.foot_height.T]


def footfalls(height: np.ndarray, threshold: float) -> np.ndarray:
    """Return the frames at which a foot of height [T] in m has come down from a swing."""
    swinging, frames = _swinging(height, threshold)
    return frames[1:][np.diff(swinging) < 0]


def swings(height: np.ndarray, threshold: float) -> int:
    """Count the rises of a height [T] to the threshold after it was below half of it."""
    swinging, _ = _swinging(height, threshold)
    return int((np.diff(swinging) > 0).sum())


def clearances(window: Recording) -> np.ndarray:
    """Return the greatest height [R, N] in m of each foot's lowest point in each stride."""
    starts = stride_starts(window)
    peaks = [window.foot_height[a:b].max(0) for a, b in itertools.pairwise(starts)]
    return np.array(peaks) if peaks else np.full((1, window.foot_height.shape[1]), np.nan)


def stride_frequency(window: Recording, clearance: float) -> float:
    """Return the frequency in Hz of strides, or of the median foot's swings if that is higher.

    clearance: height of a swing in hip heights; the foot must come down to half of it in between.
    """
    starts = stride_starts(window)
    if len(starts) < 2:
        return np.nan
    strides = 1 / (float(np.diff(starts).mean()) * window.time_step)
    threshold = clearance * window.dimensions.hip_height
    counts = [swings(height, threshold) for height in window.foot_height.T]
    return max(strides, float(np.median(counts)) / (len(window.foot_height) * window.time_step))


def _swinging(height: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """Return swing (1) or stance (0), and the frames at which that is certain."""
    state = np.where(height >= threshold, 1, np.where(height < threshold / 2, 0, -1))
    frames = np.flatnonzero(state >= 0)
    return state[frames], frames


def _unevenness(frames: np.ndarray) -> float:
    """Return the standard deviation of the times between footfalls over their mean."""
    between = np.diff(frames)
    return float(between.std() / between.mean())
