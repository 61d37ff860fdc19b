"""Motions and skeletons at rest, read from an animator's files."""

from mjxgait.animation.clips.clip import AngleTrack, Clip, Rig

__all__ = ["AngleTrack", "Clip", "Rig"]
