"""Difference between left and right motion, which reveals a limp in any gait.

Times of footfalls do not count: in a canter the left and the right fall at different times.
Letters: `J` actuated joints, `N` feet.
"""

from typing import Any

import numpy as np

from mjxgait.reference.measure import Recording
from mjxgait.tasks.walk.gaits import stations_of

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


def sides(window: Recording) -> dict[str, Any] | None:
    """Return the report's entry on left and right; None for a body without two like sides."""
    if not window.dimensions.partner:
        return None
    return {"amplitude": amplitudes_apart(window), "duty_factor": duties_apart(window)}


def pairs_of(window: Recording) -> list[tuple[int, int]]:
    """Pairs of left and right feet beside each other."""
    at = {station: foot for foot, station in enumerate(stations_of(window.dimensions.foot_places))}
    return [(foot, at[rank, False]) for (rank, left), foot in at.items() if left]
