"""Vibration of the joints: motion too fast for a stride.

Letters: `F` frequencies, `J` actuated joints.
"""

import numpy as np

from mjxgait.reference.measure import Recording
from mjxgait.tasks.walk.gaits import transition

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
    speed, step = window.joint_vel, window.time_step
    if not np.isfinite(speed).all() or not speed.any():
        return np.nan
    power, spacing = _power(speed, step), 1 / (len(speed) * step)
    first = int(np.ceil(max(SLOWEST, MULTIPLE * transition(window.dimensions.mass)) / spacing))
    sums = np.cumsum(np.pad(power, ((1, 0), (0, 0))), axis=0)[first:]
    width = max(round(BAND / spacing), 1)
    bands = sums[width:] - sums[:-width]
    return float(np.sqrt(bands.max(initial=0.0) / (speed**2).mean(0).mean()))


def _power(speed: np.ndarray, step: float) -> np.ndarray:
    """Power [F, J] in (rad/s)² at each frequency from 0 on; its sum is a joint's mean square."""
    taper = np.hanning(len(speed))[:, None]
    waves: np.ndarray = np.abs(np.fft.rfft(speed * taper, axis=0)) ** 2
    total = waves.sum(0)
    scale = (speed**2).mean(0) / np.where(total > 0, total, 1.0)
    return waves * scale
