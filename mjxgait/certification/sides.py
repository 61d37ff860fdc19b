"""How alike the left and the right of a body move: what tells a limp, whatever the gait.

When each foot falls does not count: in a canter the left and the right fall at other moments.
Letters: `J` actuated joints, `N` feet.
"""

from typing import Any

import numpy as np

from mjxgait.reference.measure import Recording
from mjxgait.tasks.walk.gaits import stations_of

STILL = 0.2
"""Of the root mean square amplitude of all joints: a pair that moves less is compared with it."""


def amplitudes_apart(window: Recording) -> float:
    """Largest difference between the amplitudes of a joint and of its mirror image, over the larger.

    An amplitude is the standard deviation of the angle. Two joints that hardly move are no limp.
    """
    partner = list(window.dimensions.partner)
    amplitude = window.joint_pos.std(0)
    least = STILL * np.sqrt((amplitude**2).mean())
    larger = np.maximum(np.maximum(amplitude, amplitude[partner]), least)
    apart = np.abs(amplitude - amplitude[partner]) / np.where(larger > 0, larger, 1.0)
    return float(apart.max(initial=0.0))


def duties_apart(window: Recording) -> float:
    """Largest difference between the duty factors of a left foot and of the right one beside it."""
    duty = window.contact.mean(0)
    return max((abs(float(duty[a] - duty[b])) for a, b in pairs_of(window)), default=0.0)


def sides(window: Recording) -> dict[str, Any] | None:
    """What the report has of left and right; None for a body without two like sides."""
    if not window.dimensions.partner:
        return None
    return {"amplitude": amplitudes_apart(window), "duty_factor": duties_apart(window)}


def pairs_of(window: Recording) -> list[tuple[int, int]]:
    """Left and right feet that stand beside each other."""
    at = {station: foot for foot, station in enumerate(stations_of(window.dimensions.foot_places))}
    return [(foot, at[rank, False]) for (rank, left), foot in at.items() if left]
