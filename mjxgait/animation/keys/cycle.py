"""Key poses of a motion: its cycle, the fewest poses for it, or those noted in the file.

The controller interpolates linearly from pose to pose (docs/reference/controller.md), so a cycle of
poses is a sum of hat functions, and linear least squares gives the best poses of a given number.

A body never reaches its targets exactly: it lags, and bends under its weight. A cycle written by
`mjxgait export` states both targets and motion; changes to the motion since then are added to the
targets.

Letters: `F` frames, `J` joints, `N` evenly spaced samples of one cycle, `K` key poses, `C` poses of
the whole cycle.
"""

import dataclasses
import json
from collections.abc import Mapping

import numpy as np

from mjxgait.controllers.key_poses.config import gene_names
from mjxgait.controllers.key_poses.serialize import PoseSerializer
from mjxgait.creature import Creature
from mjxgait.errors import UserError

SAMPLES = 120
MOST_SAMPLES = 1500
"""Most samples of a file in which a cycle is searched for."""
CLOSED = np.radians(5.0)
"""rad, root mean square; poses that differ by less count as the same pose of a cycle."""
MIRRORED = np.radians(6.0)
SHORTEST = 0.1
"""Shortest cycle in s."""
STILL = np.radians(1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Cycle:
    """One cycle of a file's motion.

    angles: [N, J] rad, the first not repeated. period: s. begins: s in the file. gap: rad, root
    mean square, between the end and the beginning before they were joined. mirrored: whether the
    second half mirrors the first; `angles` are then made exactly so. drawn: [N, J] rad before that.
    """

    angles: np.ndarray
    period: float
    begins: float
    gap: float
    mirrored: bool
    drawn: np.ndarray


def find_cycle(
    creature: Creature,
    times: np.ndarray,
    angles: np.ndarray,
    begin: float | None = None,
    end: float | None = None,
) -> Cycle:
    """One cycle of angles [F, J] at times [F] s.

    Args:
      begin, end: s, as requested. Without an end the cycle ends where the motion first repeats.

    Raises:
      UserError: nothing moves, or the ends are not usable.
    """
    first = times[0] if begin is None else begin
    last = times[-1] if end is None else end
    check_ends(times, begin, end)
    if last - first < SHORTEST:
        raise UserError(f"a cycle of {last - first:.3g} s: at least {SHORTEST} s are needed")
    if np.ptp(angles[(times >= first) & (times <= last)], axis=0).max(initial=0) < STILL:
        raise UserError(
            "nothing moves: no joint turns by a degree; name the moving seconds with --from and "
            "--to, or the joints with --names"
        )
    period = last - first if end is not None else _period(times, angles, first, last)
    samples = _sampled(times, angles, first, period, SAMPLES + 1)
    gap = float(np.sqrt(np.mean((samples[-1] - samples[0]) ** 2)))
    closing = np.linspace(0.0, 1.0, SAMPLES + 1)[:, None] * (samples[-1] - samples[0])
    whole = (samples - closing)[:-1]
    other = creature.mirror.image(np.roll(whole, -SAMPLES // 2, axis=0))
    alike = float(np.sqrt(np.mean((whole - other) ** 2)))
    mirrored = creature.mirror.symmetric and alike < MIRRORED
    angles = 0.5 * (whole + other) if mirrored else whole
    return Cycle(angles, float(period), float(first), gap, mirrored, whole)


def check_ends(times: np.ndarray, begin: float | None, end: float | None) -> None:
    """Refuse ends that are not in order, or not within the times [F] of a file, all in s.

    Raises:
      UserError: names the ends and the file's.
    """
    first = times[0] if begin is None else begin
    last = times[-1] if end is None else end
    if not times[0] <= first < last <= times[-1] + 1e-9:
        raise UserError(
            f"--from {first:g} --to {last:g}: the file has {times[0]:g} to {times[-1]:g} s"
        )


def interpolated(at: np.ndarray, times: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Angles [n, J] at times `at` [n], from the angles [F, J] at times [F]."""
    return np.stack([np.interp(at, times, column) for column in angles.T], 1)


def _sampled(
    times: np.ndarray, angles: np.ndarray, first: float, period: float, count: int
) -> np.ndarray:
    """Angles [count, J] evenly over a period, both ends included."""
    return interpolated(first + np.linspace(0.0, period, count), times, angles)


def _period(times: np.ndarray, angles: np.ndarray, first: float, last: float) -> float:
    """Period in s after which the motion repeats; the whole length if it never does.

    A closed clip holds a whole number of cycles. In any other clip the period is the shortest lag
    at which the poses repeat over the rest of the clip.
    """
    length = last - first
    count = min(max(round(length / np.median(np.diff(times))), 2), MOST_SAMPLES)
    samples = _sampled(times, angles, first, length, 4 * count + 1)
    moves = np.sqrt(np.mean(samples.std(0) ** 2))

    def differs(lag: int) -> float:
        return float(np.sqrt(np.mean((samples[lag:] - samples[: len(samples) - lag]) ** 2)))

    enough = min(CLOSED, 0.35 * moves)
    if np.sqrt(np.mean((samples[-1] - samples[0]) ** 2)) < enough:
        whole = [n for n in range(12, 1, -1) if length / n >= SHORTEST]
        lags = ((n, round(4 * count / n)) for n in whole)
        return float(length / next((n for n, lag in lags if differs(lag) < enough), 1))
    least = max(round(4 * count * SHORTEST / length), 2)
    lacks = np.array([differs(lag) for lag in range(least, 3 * count)])
    dips = [i for i in range(1, len(lacks) - 1) if lacks[i - 1] >= lacks[i] <= lacks[i + 1]]
    found = next((i for i in dips if lacks[i] < enough), None)
    return float(length if found is None else (least + found) * length / (4 * count))


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
        f"{MOST_POSES} key poses come no nearer than {np.degrees(best.error):.1f} degrees: the "
        "cycle is too lively, or --from and --to cut more than one of it; a larger --tolerance "
        "accepts it"
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


UNCHANGED = np.radians(0.5)
"""rad, root mean square of a joint; smaller differences are no edit and no asymmetry."""


@dataclasses.dataclass(frozen=True, eq=False)
class EditedWalk:
    """An exported walk with its edits.

    fit: key poses with the changes. cycle: as drawn; mirrored if the walk and the changes are.
    changed: rad, root mean square. advance: how the target moves on. tuning: genes by name.
    """

    fit: Fit
    cycle: Cycle
    changed: float
    advance: str
    tuning: Mapping[str, float]


def own_poses(creature: Creature, note: str, cycle: Cycle) -> EditedWalk | None:
    """Read the note of an exported walk of this creature; return None for any other file."""
    names = creature.joints.names
    try:
        document = json.loads(note)
        if document["creature"] != creature.digest:
            return None
        genome = PoseSerializer().genome(document, creature)
        poses = genome["key_poses"]
        motion = np.array([document["motion"][n] for n in names], float).T
        genes = gene_names(creature.corrections.steps)
        tuning = dict(zip(genes, map(float, genome["tuning"]), strict=True))
        mirrored, advance = bool(document["mirrored"]), str(document["advance"])
        numbers = np.concatenate([poses.ravel(), motion.ravel(), genome["tuning"]])
        if not (poses.ndim == motion.ndim == 2 and len(motion) > 1 and np.isfinite(numbers).all()):
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
    return EditedWalk(fit, drawn, changed, advance, tuning)


def _most(change: np.ndarray) -> float:
    """Change of the joint that changes most over a cycle [N, J]; rad, root mean square."""
    return float(np.sqrt(np.mean(change**2, 0)).max())


def _resampled(motion: np.ndarray, count: int) -> np.ndarray:
    """A cycle resampled to `count` samples [N, J]."""
    closed = np.concatenate([motion, motion[:1]])
    at = np.arange(count) / count * len(motion)
    return interpolated(at, np.arange(len(closed)), closed)
