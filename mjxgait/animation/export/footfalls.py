"""When the feet of a loop are down, for dust, sound and inverse kinematics in other programs.

Letters: `T` recorded frames of the loop, `N` feet.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_closing, binary_opening

from mjxgait.animation.export.loop import WalkLoop
from mjxgait.reference.measure import spells

BRIEF = 0.03
"""Seconds; a foot that leaves the floor, or touches it, for less than that does not step."""


@dataclasses.dataclass(frozen=True)
class Footfall:
    """A time in s for which a foot of the creature carries weight.

    down: within the motion. up: in a loop later than its end if the foot is down across the seam;
    else the end if the foot is still down there.
    """

    foot: int
    down: float
    up: float


def footfalls(loop: WalkLoop) -> list[Footfall]:
    """The footfalls in the order of `down`; a foot that never leaves has one.

    There are none without recorded frames, as of the standing pose.
    """
    walk, (first, last) = loop.walk, loop.frames
    if first == last:
        return []
    carries = walk.recording.contact[first:last]
    carries = np.roll(carries, -round(loop.begins * len(carries)), axis=0)
    step = float(loop.times[-1]) / (last - first)
    brief = max(round(BRIEF / step), 1)
    stances_of = stances if loop.strides else stances_once
    found = [
        Footfall(foot, round(down * step, 4), round(up * step, 4))
        for foot, own in enumerate(carries.T)
        for down, up in stances_of(own, brief)
    ]
    return sorted(found, key=lambda fall: (fall.down, fall.foot))


def contacts(loop: WalkLoop, names: Sequence[str]) -> list[dict[str, str | float]]:
    """The footfalls as files state them. names: of the feet [N] in the file."""
    return [
        {"foot": names[fall.foot], "down": fall.down, "up": fall.up} for fall in footfalls(loop)
    ]


def stances(carries: np.ndarray, brief: int) -> list[tuple[int, int]]:
    """First frame of each stance, and the one after its last, of a cycle [T].

    brief: frames; shorter gaps and stances do not count. The end of a stance across the cycle's
    seam is counted on from its beginning.
    """
    count = len(carries)
    down = _lasting(np.tile(carries, 3), brief, count)
    if down.all():
        return [(0, count)]
    begins = np.flatnonzero(down & ~np.roll(down, 1))
    ends = np.flatnonzero(~down & np.roll(down, 1))
    ends = np.append(ends, ends[:1] + count)
    return [(int(begin), int(ends[ends > begin][0])) for begin in begins]


def stances_once(carries: np.ndarray, brief: int) -> list[tuple[int, int]]:
    """Return the same of a motion [T] that does not repeat: its last stance ends with it."""
    return spells(_lasting(np.pad(carries, 2 * brief, mode="edge"), brief, 2 * brief))


def _lasting(wide: np.ndarray, brief: int, margin: int) -> np.ndarray:
    """Whether a foot is down, without brief gaps and stances, [T].

    wide: with so many frames of its neighbours at both ends.
    """
    closed = binary_closing(wide, np.ones(brief))
    down: np.ndarray = binary_opening(closed, np.ones(brief))[margin:-margin]
    return down
