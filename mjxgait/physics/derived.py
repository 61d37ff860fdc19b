"""Quantities that every plant derives: sensed parts, overlap depth, inverse masses.

MuJoCo scales the softness of contacts and limits with inverse masses (`body_invweight0`,
`dof_invweight0`; computation docs, "Parameters"). They are those of the body at rest, so they
change with its masses and lengths. Left out: for a body that slides on the world, turns about
nothing and carries nothing, MuJoCo takes its inverse mass instead of the mean. No part of a
creature is one.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mjxgait.creature import Creature
from mjxgait.creature.overlap import Crossings, bar_distance
from mjxgait.types import Number, pytree


@dataclasses.dataclass(frozen=True, eq=False)
class ObservationLayout:
    """Parts of a model that are sensed.

    trunk: body id. qpos_adr, dof_adr: [J] addresses of the actuated joints.
    watched: [G] geom ids; the first `feet` of them are feet.
    """

    trunk: int
    qpos_adr: np.ndarray
    dof_adr: np.ndarray
    watched: np.ndarray
    feet: int = 0


class OtherTopology(Exception):
    """Error for a body that does not fit a plant; the message says where they differ."""


def observation_layout(creature: Creature) -> ObservationLayout:
    """Layout of a creature."""
    return ObservationLayout(
        creature.trunk,
        creature.joints.qpos_adr,
        creature.joints.dof_adr,
        creature.feet.watched,
        len(creature.feet.foot_of),
    )


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


SHARED = {int(mujoco.mjtJoint.mjJNT_FREE): (3, 3), int(mujoco.mjtJoint.mjJNT_BALL): (3,)}
"""Sizes of the groups of a joint's degrees of freedom that share a weight."""


def weight_groups(kinds: Sequence[int]) -> list[range]:
    """Group the degrees of freedom that share a weight; kinds: MuJoCo's, in the model's order.

    The three shifts of a free joint share one, and so do the three turns of a free or ball joint.
    Every other degree of freedom has its own.
    """
    groups: list[range] = []
    for kind in kinds:
        for size in SHARED.get(int(kind), (1,)):
            start = groups[-1].stop if groups else 0
            groups.append(range(start, start + size))
    return groups


def inverse_weights(
    mass: jax.Array, jacobian: jax.Array, joints: Sequence[Sequence[int]]
) -> tuple[jax.Array, jax.Array]:
    """Compute the weights as `mj_setConst` does: means over the axes of J M^-1 J^T.

    Args:
      mass: [nv, nv] matrix at rest.
      jacobian: [B, 6, nv] of the bodies' centres of mass, three shifts before three turns.
      joints: groups of degrees of freedom that share one weight.

    Returns:
      [B, 2] 1/kg of shifts and 1/(kg·m²) of turns; [nv] of the degrees of freedom.
    """
    inverse = _inverse(mass)
    seen = jnp.einsum("bik,kl,bil->bi", jacobian, inverse, jacobian, precision="highest")
    bodies = jnp.stack([seen[:, :3].mean(1), seen[:, 3:].mean(1)], axis=1)
    share = np.zeros(mass.shape, np.float32)
    for group in joints:
        share[np.ix_(group, group)] = 1 / len(group)
    return bodies, jnp.dot(share, jnp.diagonal(inverse), precision="highest")


def _inverse(mass: jax.Array) -> jax.Array:
    """Invert a positive definite matrix [n, n] by Gauss-Jordan elimination.

    LAPACK is avoided: XLA's CPU calls wait for threads of the pool that they run on, so two devices
    that invert many matrices at once deadlock.
    """
    size = len(mass)

    def eliminate(k: jax.Array, both: jax.Array) -> jax.Array:
        row = both[k] / both[k, k]
        return (both - both[:, k, None] * row).at[k].set(row)

    both = jnp.concatenate([mass, jnp.eye(size, dtype=mass.dtype)], axis=1)
    return jax.lax.fori_loop(0, size, eliminate, both)[:, size:]
