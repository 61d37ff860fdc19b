"""What is read of an animator's files: motions, and skeletons at rest."""

from mjxgait.animation.clips.clip import AngleTrack, Clip
from mjxgait.animation.clips.rig import Rig

__all__ = ["AngleTrack", "Clip", "Rig"]
