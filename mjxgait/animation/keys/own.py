"""What an exported walk says of the key poses that made it, so that it can come back edited.

A body never is where its targets are: it follows late, and bends under its weight. Of a cycle that
`mjxgait export` wrote both are known; what was changed in the file since then is added to the
targets. Letters: `N` samples of a cycle, `K` key poses, `J` joints.
"""

import dataclasses
import json
from collections.abc import Mapping

import numpy as np

from mjxgait.animation.keys.cycle import Cycle, interpolated
from mjxgait.animation.keys.fit import Fit, within_range
from mjxgait.creature import Creature

UNCHANGED = np.radians(0.5)
"""rad, root mean square of a joint; what differs by less was not edited, or is the same on both
sides.
"""


@dataclasses.dataclass(frozen=True, eq=False)
class Own:
    """fit: key poses with what was changed. changed: rad, root mean square. advance: how the
    target moves on. tuning: genes by name. cycle: as it was drawn, mirrored if the walk was and what
    was changed is.
    """

    fit: Fit
    cycle: Cycle
    changed: float
    advance: str
    tuning: Mapping[str, float]


def own_poses(creature: Creature, note: str, cycle: Cycle) -> Own | None:
    """Of a file that the creature's own walk was exported to; None of every other."""
    names = creature.joints.names
    try:
        document = json.loads(note)
        if document["creature"] != creature.digest:
            return None
        poses = np.array([[pose[n] for n in names] for pose in document["key_poses"]], float)
        motion = np.array([document["motion"][n] for n in names], float).T
        tuning = {str(name): float(value) for name, value in document["tuning"].items()}
        mirrored, advance = bool(document["mirrored"]), str(document["advance"])
        if not (np.isfinite(poses).all() and np.isfinite(motion).all() and len(motion) > 1):
            return None
    except (ValueError, KeyError, TypeError, AttributeError, ArithmeticError, RecursionError):
        return None
    motion = _resampled(motion, len(cycle.drawn))
    shifts = [np.roll(cycle.drawn, -s, axis=0) for s in range(len(motion))]
    shift = int(np.argmin([np.mean((angles - motion) ** 2) for angles in shifts]))
    change = shifts[shift] - motion
    other = creature.mirror.image(np.roll(change, -len(change) // 2, axis=0))
    if mirrored and _most(change - other) >= UNCHANGED:
        poses, mirrored = np.concatenate([poses, creature.mirror.image(poses)]), False
    if _most(change) >= UNCHANGED:
        whole = len(poses) * (2 if mirrored else 1)
        poses = poses + change[np.arange(len(poses)) * len(motion) // whole]
    kept, clipped = within_range(creature, poses)
    changed = float(np.sqrt(np.mean(change**2)))
    fit = Fit(kept, changed, shift / len(motion), clipped)
    drawn = dataclasses.replace(cycle, angles=cycle.drawn, mirrored=mirrored)
    return Own(fit, drawn, changed, advance, tuning)


def _most(change: np.ndarray) -> float:
    """rad, root mean square over a cycle [N, J], of the joint that changes most."""
    return float(np.sqrt(np.mean(change**2, 0)).max())


def _resampled(motion: np.ndarray, count: int) -> np.ndarray:
    """[N, J] of samples of a cycle, as many as asked for."""
    closed = np.concatenate([motion, motion[:1]])
    at = np.arange(count) / count * len(motion)
    return interpolated(at, np.arange(len(closed)), closed)
