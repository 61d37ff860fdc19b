"""Inverse masses that constraints see, from the numbers of a body.

MuJoCo scales the softness of contacts and limits with them (`body_invweight0`, `dof_invweight0`;
computation docs, "Parameters"). They are those of the body at rest, so they change with its masses
and lengths.

Left out: for a body that slides on the world, turns about nothing and carries nothing, MuJoCo
takes its inverse mass instead of the mean. No part of a creature is one.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

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
