"""Key poses noted in an exported walk, for import after an edit.

A body never reaches its targets exactly: it lags, and bends under its weight. A cycle written by
`mjxgait export` states both targets and motion; changes to the motion since then are added to the
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
"""rad, root mean square of a joint; smaller differences are no edit and no asymmetry."""


@dataclasses.dataclass(frozen=True, eq=False)
class Own:
    """An exported walk with its edits.

    fit: key poses with the changes. cycle: as drawn; mirrored if the walk and the changes are.
    changed: rad, root mean square. advance: how the target moves on. tuning: genes by name.
    """

    fit: Fit
    cycle: Cycle
    changed: float
    advance: str
    tuning: Mapping[str, float]


def own_poses(creature: Creature, note: str, cycle: Cycle) -> Own | None:
    """Read the note of an exported walk of this creature; return None for any other file."""
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
    """Change of the joint that changes most over a cycle [N, J]; rad, root mean square."""
    return float(np.sqrt(np.mean(change**2, 0)).max())


def _resampled(motion: np.ndarray, count: int) -> np.ndarray:
    """A cycle resampled to `count` samples [N, J]."""
    closed = np.concatenate([motion, motion[:1]])
    at = np.arange(count) / count * len(motion)
    return interpolated(at, np.arange(len(closed)), closed)
