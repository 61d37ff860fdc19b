"""Overlap depth of a creature's parts: what both plants compute of `Crossings`."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from mjxgait.creature.overlap import Crossings, bar_distance
from mjxgait.types import Number, pytree


@pytree
class Bars:
    """Numbers of `Crossings`; the lanes, if any, are innermost.

    centre, half: [S, 3] m in the body's frame; a bar's middle, and from there to one end.
    radius: [S] m. reach: [Q] m; a pair's depth is its reach minus the distance of the two axes.
    body: [S], first, second: [Q] as in `Crossings`; None if they are part of the topology.
    """

    centre: Number
    half: Number
    radius: Number
    reach: Number
    body: Number | None = None
    first: Number | None = None
    second: Number | None = None


def read_bars(crossings: Crossings | None) -> Bars:
    """Read the numbers of crossings; empty arrays for None."""
    if crossings is None or not len(crossings.first):
        return Bars(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    return Bars(crossings.centre, crossings.half, crossings.radius, crossings.reach)


def resized_bars(bars: Bars, first: ArrayLike, second: ArrayLike, factor: Number) -> Bars:
    """Multiply the lengths of one body's bars by factor [S]."""
    a, b = whole(first), whole(second)
    radii = factor[a] * bars.radius[a] + factor[b] * bars.radius[b]
    # The allowed depth of two shapes scales with the mean of their factors.
    allowed = 0.5 * (factor[a] + factor[b]) * (bars.radius[a] + bars.radius[b] - bars.reach)
    return dataclasses.replace(
        bars,
        centre=bars.centre * factor[:, None],
        half=bars.half * factor[:, None],
        radius=bars.radius * factor,
        reach=radii - allowed,
    )


def deepest(
    first: ArrayLike,
    second: ArrayLike,
    bars: Bars,
    centre: jax.Array,
    half: jax.Array,
) -> jax.Array:
    """Largest depth [...] m beyond the standing depth; negative if all are apart.

    Args:
      first, second: [Q] the bars of each pair.
      bars: with as many axes as the following, 1 long where numbers are shared.
      centre, half: [S, 3, ...] m; each bar's middle, and from there to one end, in any one frame.
    """
    depth = _pair_depths(whole(first), whole(second), bars, centre, half)
    # Halves are folded; a maximum over this axis takes three times as long on CPU.
    while depth.shape[0] > 1:
        rows = (depth.shape[0] + 1) // 2
        depth = jnp.maximum(depth[:rows], depth[-rows:])
    return depth[0]


def _pair_depths(
    first: Number, second: Number, bars: Bars, centre: jax.Array, half: jax.Array
) -> jax.Array:
    """Depth [Q, ...] of each pair."""

    def parts(rows: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        return rows[:, 0], rows[:, 1], rows[:, 2]

    lengths = (bars.half**2).sum(1)
    apart = parts(centre[first] - centre[second])
    distance = bar_distance(
        apart,
        parts(half[first]),
        parts(half[second]),
        (single(lengths[first]), single(lengths[second])),
    )
    return single(bars.reach) - distance


def whole(indices: ArrayLike) -> Number:
    """Convert indices to integers; as inputs of the program they are floats."""
    if isinstance(indices, jax.Array):
        return indices.astype(jnp.int32)
    return np.asarray(indices, int)


def single(numbers: Number) -> Number:
    """Convert constants to float32, so that nothing widens."""
    return np.asarray(numbers, np.float32) if isinstance(numbers, np.ndarray) else numbers
