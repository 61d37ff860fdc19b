"""How deep parts of a creature are in each other: what both plants compute of `Crossings`."""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.creature.overlap import Crossings, bar_distance


def deepest(crossings: Crossings, centre: jax.Array, half: jax.Array) -> jax.Array:
    """[...] m; how much deeper than standing the deepest two are in each other, negative if apart.

    Args:
      centre, half: [S, 3, ...] m; each bar's middle and from there to one end, in any one frame.
    """
    depth = _pair_depths(crossings, centre, half)
    # Halves laid on each other; a maximum over this axis takes three times as long on CPU.
    while depth.shape[0] > 1:
        rows = (depth.shape[0] + 1) // 2
        depth = jnp.maximum(depth[:rows], depth[-rows:])
    return depth[0]


def _pair_depths(crossings: Crossings, centre: jax.Array, half: jax.Array) -> jax.Array:
    """[Q, ...] of each pair."""
    first, second = crossings.first, crossings.second
    column = (slice(None), *[None] * (centre.ndim - 2))

    def parts(rows: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        return rows[:, 0], rows[:, 1], rows[:, 2]

    lengths = tuple(np.asarray(x, np.float32)[column] for x in crossings.lengths())
    apart = parts(centre[first] - centre[second])
    distance = bar_distance(
        apart, parts(half[first]), parts(half[second]), (lengths[0], lengths[1])
    )
    return np.asarray(crossings.reach, np.float32)[column] - distance
