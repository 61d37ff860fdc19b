"""What an exported walk says of itself, for `mjxgait refine`."""

import json

import numpy as np

from mjxgait.animation.loop import WalkLoop
from mjxgait.champion.codecs import codec_of
from mjxgait.clips.clip import NOTE

SAMPLES = 60
"""Of a cycle's motion."""


def note_of(loop: WalkLoop) -> dict[str, str]:
    """The key poses of a walk and the motion that they made, as one text that editors keep."""
    champion, creature = loop.walk.champion, loop.walk.creature
    if champion.controller != "poses" or not loop.strides:
        return {}
    joints = creature.joints
    at = np.arange(SAMPLES) / SAMPLES * (len(loop.qpos) - 1) / loop.strides
    frames = np.arange(len(loop.qpos))
    motion = {
        name: [round(float(v), 5) for v in np.interp(at, frames, loop.qpos[:, place])]
        for name, place in zip(joints.names, joints.qpos, strict=True)
    }
    known = codec_of("poses").document(champion.genome, champion.settings, creature)
    document = {
        "creature": champion.digest,
        "advance": champion.settings.advance,
        "motion": motion,
    }
    return {NOTE: json.dumps(document | known)}
