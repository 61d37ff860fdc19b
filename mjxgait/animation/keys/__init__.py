"""A cycle that somebody has keyed or captured: read, matched, and turned into key poses."""

from mjxgait.animation.keys.bring import Brought, bring

__all__ = ["Brought", "bring"]
