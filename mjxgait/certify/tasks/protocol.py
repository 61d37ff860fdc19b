"""What the examiner asks of a task."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from mjxgait.certify.config import CertificateConfig
from mjxgait.certify.criteria import Criterion
from mjxgait.certify.measure import Recording
from mjxgait.creature import Creature


class Demands(Protocol):
    """Criteria of one task. Criteria 4 and 5, staying up when disturbed, are everybody's."""

    verdict: str
    """What one that passes does."""

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """What a recording decides that nobody has disturbed; `halved` had half the time step."""
        ...

    def report(self, window: Recording, config: CertificateConfig) -> dict[str, Any]:
        """Numbers without a threshold; `summary` is a line for the screen."""
        ...

    def promising(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> bool:
        """Whether an individual with these outcomes [R] in evolution is worth an examination.

        seconds: of an episode.
        """
        ...
