"""Acceptance criteria of `turn`, in NumPy."""

from collections.abc import Mapping

import numpy as np
from typing_extensions import override

from mjxgait.certification.acceptance import PlainCriteria, to_the_end
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least, at_most, steady
from mjxgait.certification.describe import vibration
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording

RATE = 20.0
"""Least mean turn in deg/s."""
HALF = 0.7
"""Least turn in the second half of the time over the turn in the first."""
AWAY = 2.0
"""Largest distance from the start in hip heights."""


class TurnCriteria(PlainCriteria):
    """Implementation of `AcceptanceCriteria`: stays up, and turns on the spot without vibrating."""

    verdict = "it turns on the spot"

    def __init__(self) -> None:
        super().__init__(self)

    @staticmethod
    def criteria(window: Recording) -> tuple[Criterion, ...]:
        """Return criteria 10 and 11."""
        turned = np.degrees(_heading(window))
        seconds, half = len(turned) * window.time_step, len(turned) // 2
        first, second = turned[half] - turned[0], turned[-1] - turned[half]
        away = np.linalg.norm(window.trunk_pos[:, :2] - window.trunk_pos[0, :2], axis=1)
        near = away.max() / window.dimensions.hip_height
        shakes = vibration(window, CertificateConfig().gait)
        return (
            Criterion(
                10,
                "turns",
                (
                    at_least("turn (deg/s)", (turned[-1] - turned[0]) / seconds, RATE),
                    steady("second half's turn / first", first, second, HALF),
                ),
            ),
            Criterion(
                11, "on the spot", (at_most("from the start / hip height", near, AWAY), shakes)
            ),
        )

    @override
    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        window = whole.window(config.warmup)
        turned = np.degrees(np.ptp(_heading(window)))
        rate = turned / (len(window.trunk_pos) * window.time_step)
        return super().report(whole, config) | {"turn": rate, "summary": f"{rate:.0f} deg/s"}

    @override
    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        fast = np.degrees(outcome["turned"]) >= RATE * seconds
        managed: np.ndarray = to_the_end(outcome, seconds, creature) & fast
        return managed


def _heading(window: Recording) -> np.ndarray:
    """Heading [T] in rad; NaN if it was not recorded."""
    return np.full(len(window.trunk_pos), np.nan) if window.heading is None else window.heading
