"""The fewest key poses that reproduce a cycle.

The controller interpolates linearly from pose to pose (docs/controller.md), so a cycle of poses is
a sum of hat functions, and linear least squares gives the best poses of a given number. Letters:
`N` samples of a cycle, `K` key poses, `C` poses of the whole cycle, `J` joints.
"""

import dataclasses

import numpy as np

from mjxgait.animation.keys.cycle import Cycle
from mjxgait.creature import Creature
from mjxgait.errors import UserError

MOST_POSES = 12
SEEN = 0.5
"""deg; a smaller loss at a pose range is not visible."""
TURNS = 4
"""Number of places tried for the first pose, within the first 1 / K of the cycle."""


@dataclasses.dataclass(frozen=True, eq=False)
class Fit:
    """Key poses fitted to a cycle.

    key_poses: [K, J] rad. error: rad, root mean square over the cycle. starts: the first pose's
    place as a share of the cycle. clipped: deg by joint, the most that its pose range cuts off.
    """

    key_poses: np.ndarray
    error: float
    starts: float
    clipped: dict[str, float]


def fit_poses(creature: Creature, cycle: Cycle, tolerance: float) -> Fit:
    """The fewest key poses within a tolerance in rad, root mean square.

    Raises:
      UserError: even `MOST_POSES` are not within it.
    """
    for count in range(2, MOST_POSES + 1):
        best = min((_fitted(creature, cycle, count, turn) for turn in _turns(count)), key=_error)
        if best.error <= tolerance:
            return best
    raise UserError(
        f"{MOST_POSES} key poses come no nearer than {np.degrees(best.error):.1f} degrees: the cycle "
        "is too lively, or --from and --to cut more than one of it; a larger --tolerance accepts it"
    )


def _error(fit: Fit) -> float:
    return fit.error


def _turns(count: int) -> np.ndarray:
    return np.arange(TURNS) / (TURNS * count)


def _fitted(creature: Creature, cycle: Cycle, count: int, starts: float) -> Fit:
    samples = cycle.angles
    whole = 2 * count if cycle.mirrored else count
    place = (np.arange(len(samples)) / len(samples) - starts) % 1.0 * whole
    hats = np.maximum(0.0, 1.0 - np.abs((place[:, None] - np.arange(whole) + 1) % whole - 1))
    poses = np.linalg.lstsq(hats, samples, rcond=None)[0]
    if cycle.mirrored:
        poses = 0.5 * (poses[:count] + creature.mirror.image(poses[count:]))
    full = np.concatenate([poses, creature.mirror.image(poses)]) if cycle.mirrored else poses
    error = float(np.sqrt(np.mean((hats @ full - samples) ** 2)))
    kept, clipped = within_range(creature, poses)
    return Fit(kept, error, starts, clipped)


def within_range(creature: Creature, poses: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    """Key poses [K, J] within the pose ranges, and the largest visible loss in deg by joint."""
    joints = creature.joints
    kept = np.clip(poses, joints.pose_low, joints.pose_high)
    lost = np.degrees(np.abs(poses - kept).max(0))
    return kept, {n: float(v) for n, v in zip(joints.names, lost, strict=True) if v > SEEN}
