"""Acceptance criteria for jumping: the whole body off the ground, as high as in evolution.

Letters: `T` frames, `P` spans of time.
"""

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least
from mjxgait.champion import Champion
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.modular.criteria import BlocksDemands, counted, seen
from mjxgait.tasks.modular.thresholds import JumpConfig

SPAN = 2.0
"""Length of a span in s; the body must jump in each. A single highest leap is chance."""


class JumpDemands(BlocksDemands):
    """See `Demands`: it jumps again and again, from perturbed starts too."""

    verdict = "it jumps"
    verb = "jumps"
    promised = evidence = "height"
    leaps = True

    def wanted(self, config: CertificateConfig) -> JumpConfig:
        """See `BlocksDemands`."""
        return config.jump

    def second(self, window: Recording, config: CertificateConfig) -> Criterion:
        """See `BlocksDemands`."""
        height = at_least("height of the lowest part (m)", self.done(window), config.jump.height)
        return Criterion(2, "jumps", (height,))

    def done(self, window: Recording) -> float:
        """See `BlocksDemands`: m, of the lowest part at the best moment, mean of the spans."""
        return float(np.mean(highest(seen(window).low, window.time_step)))

    def promise(self, champion: Champion, seconds: float, config: CertificateConfig) -> float:
        """See `BlocksDemands`: for the undisturbed trial, not for all."""
        return float(champion.origin.get("nominal", {}).get("height", np.nan))

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those with a high enough leap in the median span."""
        low = counted(outcome.low, outcome, config)
        middling = np.median(highest(low, outcome.trajectory.time_step), axis=-1)
        return outcome.stayed_up & (middling >= config.jump.height)

    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """See `BlocksDemands`: m, a quarter above the threshold."""
        return 1.25 * config.jump.height


def highest(low: np.ndarray, time_step: float) -> np.ndarray:
    """Greatest height [..., P] in m of the lowest part in each span; low: [..., T] m."""
    count = max(round(low.shape[-1] * time_step / SPAN), 1)
    spans = np.array_split(low, count, axis=-1)
    return np.stack([np.maximum(span.max(axis=-1), 0.0) for span in spans], axis=-1)
