"""Loops that begin at the same phase of a stride, so that programs can blend them."""

import dataclasses

import numpy as np

from mjxgait.animation.export.loop import WalkLoop, walk_loop
from mjxgait.creature import Creature
from mjxgait.reference.strides import falls_of_feet
from mjxgait.rendering.walk import Walk


def stride_in_phase(walk: Walk, rate: int) -> WalkLoop:
    """One stride of a walk as a loop that begins when the creature's first foot comes down.

    If that foot never leaves the floor, the loop begins with the controller's cycle.

    Raises:
      UserError: the walk has no steady stride.
    """
    loop = walk_loop(walk, rate, most=1)
    first, last = loop.frames
    falls, count = falls_of_first_foot(walk), len(loop.qpos) - 1
    within = falls[(falls >= first) & (falls < last)]
    if not len(within):
        return loop
    at = round((within[0] - first) / (last - first) * count)
    turned = np.roll(loop.qpos[:-1], -at, axis=0)
    return dataclasses.replace(loop, qpos=np.concatenate([turned, turned[:1]]))


def falls_of_first_foot(walk: Walk) -> np.ndarray:
    """Recorded frames at which the creature's first foot comes down."""
    return falls_of_feet(walk.recording)[0]


def standing_still(like: WalkLoop) -> WalkLoop:
    """One second of the standing pose; it is not simulated."""
    creature: Creature = like.walk.creature
    stand = creature.stand_qpos.copy()
    place = creature.root_qpos
    stand[place : place + 2] = 0.0
    qpos = np.tile(stand, (like.rate + 1, 1))
    return dataclasses.replace(like, qpos=qpos, strides=0, advance=0.0, stretched=1.0, turned=0.0)
