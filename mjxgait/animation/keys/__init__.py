"""Import of a keyed or captured cycle: read the file, match names, fit key poses."""

from mjxgait.animation.keys.bring import Brought, bring

__all__ = ["Brought", "bring"]
