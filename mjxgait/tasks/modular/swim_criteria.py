"""Acceptance criteria for swimming: advance straight, as in evolution, by the water alone."""

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_most
from mjxgait.controllers.sims_brain.reference_body.material import DRAG
from mjxgait.reference.measure import Recording
from mjxgait.tasks.modular.criteria import GoingDemands, seen
from mjxgait.tasks.modular.thresholds import SwimConfig


class SwimDemands(GoingDemands):
    """See `Demands`. In water there is no up."""

    verdict = "it swims"
    verb = "swims"
    drag = DRAG

    def wanted(self, config: CertificateConfig) -> SwimConfig:
        """See `GoingDemands`."""
        return config.swim

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """See `GoingDemands`: 11, the source of the momentum."""
        return (by_water(window, config.swim),)


def by_water(window: Recording, config: SwimConfig) -> Criterion:
    """11. All momentum comes from the water: not from elsewhere, nor from the error of a step."""
    water = seen(window)
    given = np.cumsum(water.push[:-1], axis=0) * window.time_step
    lacking = np.linalg.norm(water.momentum[1:] - water.momentum[0] - given, axis=1)
    exchanged = np.linalg.norm(water.push, axis=1).sum() * window.time_step
    share = lacking.max() / exchanged if exchanged > 0 else np.nan
    measure = at_most("momentum from elsewhere / exchanged", share, config.elsewhere)
    return Criterion(11, "by water alone", (measure,))
