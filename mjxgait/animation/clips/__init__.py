"""Motions and skeletons at rest, read from an animator's files."""

from mjxgait.animation.clips.clip import AngleTrack, Clip
from mjxgait.animation.clips.rig import Rig

__all__ = ["AngleTrack", "Clip", "Rig"]
