"""Acceptance criteria for limbo: those of hopping, and staying clear of the bar."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.hop.criteria import HopDemands
from mjxgait.tasks.hop.thresholds import LimboConfig

ENOUGH = 0.01
"""m; more clearance is no better."""


class LimboDemands(HopDemands):
    """See `Demands`. Goals lie beyond the bar, so arrival implies passing it."""

    verdict = "it gets to its goal beneath the bar and stays"

    def wanted(self, config: CertificateConfig) -> LimboConfig:
        """See `GoalDemands`."""
        return config.limbo

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """See `Demands`: a goal and a bar for each simulation without one."""
        bar = np.array([config.limbo.place, config.limbo.height])
        given = np.where(np.isfinite(starts.bar), starts.bar, bar)
        return dataclasses.replace(super().aimed(starts, config, rng), bar=given)

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that stayed up and clear, arrived, and stayed there."""
        clear: np.ndarray = outcome.clearance > config.limbo.clearance
        return super().succeeded(outcome, starts, config) & clear

    def lost(self, outcome: Outcome, starts: Starts, steps: int) -> np.ndarray:
        """See `Demands`: as for hopping, and any contact with the bar."""
        touched = outcome.clearance <= CertificateConfig().limbo.clearance
        return super().lost(outcome, starts, steps) | touched

    def basic(self, whole: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """See `GoalDemands`: 1, 2 and 3."""
        least, room = _least(whole), config.limbo.clearance
        clear = at_least("least clearance (m)", least, room, room + ENOUGH)
        return (*super().basic(whole, config), Criterion(3, "clear of the bar", (clear,)))

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """See `Demands`: as for hopping, and the least clearance."""
        told = super().report(whole, config)
        least = _least(whole)
        bar = f"a bar {config.limbo.height:g} m high {'cleared' if least > 0 else 'touched'}"
        return told | {"clearance": least, "summary": f"{told['summary']}; {bar}"}

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """See `Demands`: as for hopping, and clear of the bar of the certification.

        The bar in evolution may be lower.
        """
        clear = outcome["bar"] <= CertificateConfig().limbo.height
        return super().managed(outcome, seconds, creature) & clear


def _least(whole: Recording) -> float:
    """Least clearance in m over all frames; NaN if one is NaN, or if none was recorded."""
    return np.nan if whole.clearance is None else float(whole.clearance.min())
