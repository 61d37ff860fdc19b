"""Whole strides of a walk, closed so that the end meets the beginning.

Letters: `F` key frames, `nq nv` as in MuJoCo.
"""

import dataclasses

import mujoco
import numpy as np

from mjxgait.champion.blocks.material import IN_WATER
from mjxgait.errors import UserError
from mjxgait.viewing.walk import Walk

RATES = (24, 30, 60)
MOST_STRIDES = 4
TOLERANCE = 0.01
"""Change of speed that fitting the strides to whole frames may cost before another stride is
taken in.
"""


@dataclasses.dataclass(frozen=True, eq=False)
class WalkLoop:
    """Key frames in place: the creature stays above the origin of the world.

    walk: they were taken from. qpos: [F, nq], in a loop the last equal to the first. rate:
    frames/s. strides: in the loop; 0 if it is none.
    advance: m that the creature moves forward in one loop; the travelling walk adds it evenly.
    stretched: duration over the recorded one.
    """

    walk: Walk
    qpos: np.ndarray
    rate: int
    strides: int
    advance: float
    stretched: float

    @property
    def times(self) -> np.ndarray:
        """[F] s."""
        return np.arange(len(self.qpos)) / self.rate

    @property
    def speed(self) -> float:
        """m/s."""
        return float(self.advance / self.times[-1])


def walk_loop(walk: Walk, rate: int = 30) -> WalkLoop:
    """The steadiest strides of a walk as a loop of whole frames.

    Raises:
      UserError: the walk has no steady stride.
    """
    chosen = _fitting_strides(walk, rate)
    if chosen is None and walk.champion.task in IN_WATER:
        raise UserError(
            f"{walk.creature.name}: a swimmer has no strides to make a loop of; `mjxgait render` "
            "shows it"
        )
    if chosen is None:
        why = (
            f"it fell after {walk.fell:.2f} s"
            if np.isfinite(walk.fell)
            else f"none was completed in {walk.seconds:g} s"
        )
        raise UserError(
            f"{walk.creature.name}: the champion has no steady stride to make a loop of ({why}); "
            "train it for longer"
        )
    first, last, strides, count = chosen
    share = np.linspace(0.0, 1.0, count + 1)
    model = walk.creature.model
    qpos = np.array([_between(model, walk.qpos, first + s * (last - first)) for s in share])
    gap = _difference(model, qpos[-1], qpos[0])
    root = int(model.jnt_dofadr[model.body_jntadr[walk.creature.trunk]])
    advance = float(-gap[root : root + 2] @ walk.forward)
    # What the end lacks to be the beginning is added little by little.
    qpos = np.array([_integrate(model, q, s * gap) for q, s in zip(qpos, share, strict=True)])
    qpos[-1] = qpos[0]
    place = int(model.jnt_qposadr[model.body_jntadr[walk.creature.trunk]])
    # Shown where a viewer's own floor is, or none: on ground that is no plane at its mean height.
    below = walk.ground_heights(walk.qpos[first:last, place : place + 2])
    qpos[:, place + 2] -= below.mean() - 0.5 * (below[-1] - below[0])
    qpos[:, place : place + 2] -= qpos[:-1, place : place + 2].mean(0)
    return WalkLoop(
        walk, qpos, rate, strides, advance, count / rate / ((last - first) * walk.time_step)
    )


def walk_take(walk: Walk, rate: int = 30) -> WalkLoop:
    """The whole walk as it was, also one that falls, in place and with a seam."""
    model, trunk = walk.creature.model, walk.creature.trunk
    count = max(int(walk.seconds * rate), 2)
    qpos = np.array([_between(model, walk.qpos, i / rate / walk.time_step) for i in range(count)])
    place = int(model.jnt_qposadr[model.body_jntadr[trunk]])
    advance = float((qpos[-1, place : place + 2] - qpos[0, place : place + 2]) @ walk.forward)
    share = np.linspace(0.0, 1.0, count)[:, None]
    qpos[:, place + 2] -= walk.ground_heights(qpos[:, place : place + 2])
    qpos[:, place : place + 2] -= (1 - share) * qpos[0, place : place + 2] + share * qpos[
        -1, place : place + 2
    ]
    return WalkLoop(walk, qpos, rate, 0, advance, 1.0)


def _fitting_strides(walk: Walk, rate: int) -> tuple[int, int, int, int] | None:
    """First and last recorded frame, number of strides, and of key frames; the fewest strides
    that fit the frames well.
    """
    found = []
    for strides in range(1, MOST_STRIDES + 1):
        if (ends := walk.steady_strides(strides)) is None:
            break
        seconds = (ends[1] - ends[0]) * walk.time_step
        count = max(round(seconds * rate), 2)
        error = abs(count / rate / seconds - 1)
        found.append((error, (*ends, strides, count)))
        if error < TOLERANCE:
            break
    return min(found)[1] if found else None


def _between(model: mujoco.MjModel, qpos: np.ndarray, at: float) -> np.ndarray:
    """The pose [nq] at a fractional frame of poses [T, nq]."""
    low = min(int(at), len(qpos) - 2)
    return _integrate(model, qpos[low], (at - low) * _difference(model, qpos[low], qpos[low + 1]))


def _difference(model: mujoco.MjModel, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """[nv] that leads from one pose to another."""
    change = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, change, 1.0, start, end)
    return change


def _integrate(model: mujoco.MjModel, qpos: np.ndarray, change: np.ndarray) -> np.ndarray:
    moved = qpos.copy()
    mujoco.mj_integratePos(model, moved, change, 1.0)
    return moved
