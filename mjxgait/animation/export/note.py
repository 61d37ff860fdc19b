"""Note on an exported walk's origin, for `mjxgait refine`."""

import json

import numpy as np

from mjxgait.animation.clips.clip import NOTE
from mjxgait.animation.export.loop import WalkLoop
from mjxgait.champion.serializers import codec_of

SAMPLES = 120
"""Samples of a cycle's motion, as many as the reader uses."""


def note_of(loop: WalkLoop) -> dict[str, str]:
    """The key poses of a walk and the resulting motion, as one text that editors keep."""
    champion, creature = loop.walk.champion, loop.walk.creature
    if champion.controller != "poses" or not loop.strides:
        return {}
    joints = creature.joints
    motion = {
        name: [round(float(v), 5) for v in _stride(loop, loop.qpos[:, place])]
        for name, place in zip(joints.names, joints.qpos, strict=True)
    }
    known = codec_of("poses").document(champion.genome, champion.settings, creature)
    document = {
        "creature": champion.digest,
        "advance": champion.settings.advance,
        "motion": motion,
    }
    return {NOTE: json.dumps(document | known)}


def _stride(loop: WalkLoop, angles: np.ndarray) -> np.ndarray:
    """The first stride of angles [F], closed: the gap at its end is spread over it."""
    share = np.linspace(0.0, 1.0, SAMPLES + 1)
    at = share * (len(angles) - 1) / loop.strides
    samples = np.interp(at, np.arange(len(angles)), angles)
    closed: np.ndarray = (samples - share * (samples[-1] - samples[0]))[:-1]
    return closed
