"""Acceptance criteria of a user-defined task: no fall, no exploit, and those of its class."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import (
    Criterion,
    at_most,
    parts,
    physics,
    speed,
    upright,
)
from mjxgait.certification.describe import worst_overlap
from mjxgait.certification.tasks.staying import StaysUp, to_the_end
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording


class HasCriteria(Protocol):
    """Task class with criteria of its own, such as `tasks.plain.PlainTask`."""

    @classmethod
    def criteria(cls, window: Recording) -> tuple[Criterion, ...]:
        """Return the task's own criteria, numbered from 10."""
        ...


class PlainDemands(StaysUp):
    """See `Demands`."""

    verdict = "it does what its task demands"

    def __init__(self, task: HasCriteria) -> None:
        self.task = task

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: stays up, at half the time step too; physics, parts, and its own."""
        window = whole.window(config.warmup)
        repeated = self._basic(halved, config)
        failed = sum(not m.passed for c in repeated for m in c.measures)
        return (
            *self._basic(whole, config),
            Criterion(
                6,
                "half the time step",
                (at_most("failures in criterion 1 and its own", failed, 0.0),),
            ),
            physics(window, config.physics),
            parts(window, config.parts),
        )

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """See `Demands`."""
        window = whole.window(config.warmup)
        v = speed(window)
        return {"speed": v, "overlap": worst_overlap(window), "summary": f"{v:.2f} m/s"}

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """See `Demands`: to the end."""
        return to_the_end(outcome, seconds, creature)

    def _basic(self, whole: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        window = whole.window(config.warmup)
        return (upright(whole, window, config.upright), *self.task.criteria(window))
