"""A cycle that somebody has keyed or captured: read, matched, and turned into key poses."""

from mjxgait.keys.bring import Brought, bring
from mjxgait.keys.clip import AngleTrack, Clip

__all__ = ["AngleTrack", "Brought", "Clip", "bring"]
