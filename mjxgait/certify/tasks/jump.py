"""What is demanded of blocks that jump: to be off the ground as a whole, as high as evolution said."""

import numpy as np

from mjxgait.certify.config import CertificateConfig
from mjxgait.certify.criteria import Criterion, at_least
from mjxgait.certify.measure import Recording
from mjxgait.certify.outcome import Outcome
from mjxgait.certify.starts import Starts
from mjxgait.certify.tasks.blocks import BlocksDemands, seen
from mjxgait.certify.thresholds.blocks import JumpConfig
from mjxgait.champion import Champion

SPAN = 2.0
"""s; in each of so many it is to jump, as in evolution. The highest leap of all is chance."""


class JumpDemands(BlocksDemands):
    """See `Demands`: over and over. Of one that is disturbed a single jump is enough."""

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
        """See `BlocksDemands`: m of its lowest part at the best moment, mean of the spans."""
        low = seen(window).low
        spans = np.array_split(low, max(round(len(low) * window.time_step / SPAN), 1))
        return float(np.mean([max(span.max(), 0.0) for span in spans]))

    def promise(self, champion: Champion, seconds: float, config: CertificateConfig) -> float:
        """See `BlocksDemands`: of the trial that nothing disturbs, not of all."""
        return float(champion.origin.get("nominal", {}).get("height", np.nan))

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that were high enough once."""
        return outcome.stayed_up & (outcome.height >= config.jump.height)

    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """See `BlocksDemands`: m, a quarter higher than it must be."""
        return 1.25 * config.jump.height
