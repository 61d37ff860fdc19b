"""How deep parts of a creature are in each other: what both plants compute of `Crossings`."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from mjxgait.creature.overlap import Crossings, bar_distance
from mjxgait.types import Number, pytree


@pytree
class Bars:
    """The numbers of `Crossings`; lanes, where they are, innermost.

    centre, half: [S, 3] m in the body's frame, a bar's middle and from there to an end.
    radius: [S] m. reach: [Q] m; a pair's depth is this minus the distance of the two axes.
    body: [S], first, second: [Q] as in `Crossings`, where they are no part of the topology.
    """

    centre: Number
    half: Number
    radius: Number
    reach: Number
    body: Number | None = None
    first: Number | None = None
    second: Number | None = None


def read_bars(crossings: Crossings | None) -> Bars:
    """Of these; none of None."""
    if crossings is None or not len(crossings.first):
        return Bars(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    return Bars(crossings.centre, crossings.half, crossings.radius, crossings.reach)


def resized_bars(bars: Bars, first: ArrayLike, second: ArrayLike, factor: Number) -> Bars:
    """One body's bars with their lengths times factor [S]."""
    a, b = whole(first), whole(second)
    radii = factor[a] * bars.radius[a] + factor[b] * bars.radius[b]
    # How deep two shapes stand in each other follows their mean.
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
    """[...] m; how much deeper than standing the deepest two are in each other, negative if apart.

    Args:
      first, second: [Q] the bars of each pair.
      bars: with as many axes as the following, 1 long where the numbers are the same.
      centre, half: [S, 3, ...] m; each bar's middle and from there to one end, in any one frame.
    """
    depth = _pair_depths(whole(first), whole(second), bars, centre, half)
    # Halves laid on each other; a maximum over this axis takes three times as long on CPU.
    while depth.shape[0] > 1:
        rows = (depth.shape[0] + 1) // 2
        depth = jnp.maximum(depth[:rows], depth[-rows:])
    return depth[0]


def _pair_depths(
    first: Number, second: Number, bars: Bars, centre: jax.Array, half: jax.Array
) -> jax.Array:
    """[Q, ...] of each pair."""

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
    """Indices, which are numbers like all others where they are inputs of the program."""
    if isinstance(indices, jax.Array):
        return indices.astype(jnp.int32)
    return np.asarray(indices, int)


def single(numbers: Number) -> Number:
    """Numbers, constants among them as float32, so that nothing widens."""
    return np.asarray(numbers, np.float32) if isinstance(numbers, np.ndarray) else numbers
