"""A cycle that somebody has keyed or captured: read, matched, and turned into key poses."""

from mjxgait.keys.bring import Brought, bring

__all__ = ["Brought", "bring"]
