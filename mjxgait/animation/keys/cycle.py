"""Finds the cycle in angles over time, and whether its second half mirrors the first.

Letters: `F` frames, `J` joints, `N` evenly spaced samples of one cycle.
"""

import dataclasses

import numpy as np

from mjxgait.creature import Creature
from mjxgait.errors import UserError

SAMPLES = 120
CLOSED = np.radians(5.0)
"""rad, root mean square; poses that differ by less are the same of a cycle."""
MIRRORED = np.radians(6.0)
SHORTEST = 0.1
"""s of a cycle."""
STILL = np.radians(1.0)


@dataclasses.dataclass(frozen=True, eq=False)
class Cycle:
    """angles: [N, J] rad over one cycle, the first not repeated. period: s. begins: s in the file.

    gap: rad, root mean square, between the end and the beginning before they were joined.
    mirrored: whether the second half is the mirror image of the first; then it is made so exactly.
    drawn: [N, J] rad before that.
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
      begin, end: s; what the user says of its ends. Without an end it is where the motion first
        comes back to itself.

    Raises:
      UserError: nothing moves, or the ends are none.
    """
    first = times[0] if begin is None else begin
    last = times[-1] if end is None else end
    if not times[0] <= first < last <= times[-1] + 1e-9:
        raise UserError(
            f"--from {first:g} --to {last:g}: the file has {times[0]:g} to {times[-1]:g} s"
        )
    if last - first < SHORTEST:
        raise UserError(f"a cycle of {last - first:.3g} s: at least {SHORTEST} s are needed")
    if np.ptp(angles[(times >= first) & (times <= last)], axis=0).max(initial=0) < STILL:
        raise UserError("nothing moves: no joint turns by a degree")
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


def interpolated(at: np.ndarray, times: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """[n, J] at other times [n] than those [F] of the angles [F, J]."""
    return np.stack([np.interp(at, times, column) for column in angles.T], 1)


def _sampled(
    times: np.ndarray, angles: np.ndarray, first: float, period: float, count: int
) -> np.ndarray:
    """[count, J] evenly over a period, both ends included."""
    return interpolated(first + np.linspace(0.0, period, count), times, angles)


def _period(times: np.ndarray, angles: np.ndarray, first: float, last: float) -> float:
    """s after which the motion is what it was; all there is where it never is.

    A clip that closes holds a whole number of cycles; in any other the shortest lag is looked for
    at which the poses come back over the rest of the clip.
    """
    length = last - first
    count = max(round(length / np.median(np.diff(times))), 2)
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
