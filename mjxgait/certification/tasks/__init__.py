"""Acceptance criteria of each task."""

from mjxgait.certification.tasks.protocol import Demands, promising
from mjxgait.certification.tasks.registry import demands_of, how_simulated

__all__ = ["Demands", "demands_of", "how_simulated", "promising"]
