"""Reference controllers: one per kind, in NumPy and float64, for many simulations at once."""

from mjxgait.reference.controllers.protocol import Command, Memory, Twin
from mjxgait.reference.controllers.registry import twin_of

__all__ = ["Command", "Memory", "Twin", "twin_of"]
