"""A creature's up and forward in a file's axes.

Letters: `F` frames, `B` bones. Axes are [3, 3], from the creature's world to the file's.
"""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from mjxgait.animation.clips.clip import Clip
from mjxgait.animation.keys.retarget import retarget
from mjxgait.creature import Creature
from mjxgait.errors import UserError

WAYS = {"z": (0, 0, 1), "-z": (0, 0, -1), "x": (1, 0, 0), "-x": (-1, 0, 0)}
"""Directions in which the file's creature looks at rest, in the file's axes with Y up."""
USUAL = "z"
TRIED = 12
"""Number of frames on which two guesses are compared."""


def axes_of(
    creature: Creature, clip: Clip, bones: Mapping[str, str], way: str | None
) -> np.ndarray:
    """The axes of a file.

    Without a way these are the usual ones, or those of the file that the creature was imported
    from, if its joints can then follow the motion better.

    Args:
      bones: bone by the name of the part. way: direction in which the file's creature looks, Y
        being up.
    """
    usual, own = facing(creature, way or USUAL), rig_axes(creature)
    if way or own is None or np.allclose(own, usual, atol=1e-3):
        return usual
    few = np.linspace(0, len(clip.times) - 1, TRIED).astype(int)
    short = dataclasses.replace(clip, times=clip.times[few], turned=clip.turned[few])

    def lacks(axes: np.ndarray) -> float:
        errors = retarget(creature, short, bones, axes).errors.values()
        return float(np.mean(np.square([*errors])))

    return min((usual, own), key=lacks)


def facing(creature: Creature, way: str) -> np.ndarray:
    """The axes of a file with Y up and the creature looking along a way.

    Raises:
      UserError: there is no such way.
    """
    if way not in WAYS:
        raise UserError(f'forward = "{way}": must be one of {", ".join(WAYS)}')
    forward, left = creature.frame.start_axes
    own = np.stack([left, [0.0, 0.0, 1.0], forward])
    ahead, up = np.array(WAYS[way], float), np.array([0.0, 1.0, 0.0])
    return np.stack([np.cross(up, ahead), up, ahead], 1) @ own


def rig_axes(creature: Creature) -> np.ndarray | None:
    """The axes of the file that the creature was imported from; None if it was not a rig."""
    if not creature.is_rig:
        return None
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.rest_qpos
    mujoco.mj_kinematics(creature.model, data)
    return np.array(data.xmat[creature.trunk].reshape(3, 3).T)
