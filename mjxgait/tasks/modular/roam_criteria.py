"""Acceptance criteria for modular bodies that walk: advance straight, without tipping over."""

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least
from mjxgait.reference.measure import Recording
from mjxgait.tasks.modular.criteria import GoingDemands
from mjxgait.tasks.modular.thresholds import RoamConfig


class RoamDemands(GoingDemands):
    """See `Demands`. Only level distance counts: leaping up gains nothing."""

    verdict = "it walks"
    verb = "walks"
    axes = 2

    def wanted(self, config: CertificateConfig) -> RoamConfig:
        """See `GoingDemands`."""
        return config.roam

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """See `GoingDemands`: 1, the side that was up after settling stays up."""
        return (balanced(window, config.roam),)


def balanced(window: Recording, config: RoamConfig) -> Criterion:
    """1. The body does not tip over from its settled attitude."""
    up = np.stack([-np.sin(window.pitch), np.sin(window.roll), window.trunk_up], axis=1)
    upright = (up @ up[0]).min()
    return Criterion(1, "balance", (at_least("least upright", upright, config.min_up, 1.0),))
