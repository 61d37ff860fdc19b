"""Search for the cycle in angles over time, and for the mirror symmetry of its halves.

Letters: `F` frames, `J` joints, `N` evenly spaced samples of one cycle.
"""

import dataclasses

import numpy as np

from mjxgait.creature import Creature
from mjxgait.errors import UserError

SAMPLES = 120
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
