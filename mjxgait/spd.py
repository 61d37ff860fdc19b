"""Stable proportional-derivative control (Tan, Liu & Turk 2011, "Stable proportional-derivative controllers", eq. 12).

The three parts are elementwise, so that they serve one creature or a batch; what lies between the second and the third, the solve
with `M + h diag(kd)`, belongs to whoever holds the mass matrix. `stable_pd` joins them for one creature with a dense matrix.
"""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike


def pd_force(
    pos: jax.Array, vel: jax.Array, target: jax.Array, kp: ArrayLike, kd: ArrayLike, step: ArrayLike
) -> jax.Array:
    """Spring and damper at the end of the coming step: `-kp (q + h v - target) - kd v`; all [J], step in s (0 gives plain PD); N·m."""
    return -jnp.asarray(kp) * (pos + step * vel - target) - jnp.asarray(kd) * vel


def limited_torque(
    force: jax.Array, acceleration: jax.Array, brake: ArrayLike, limit: ArrayLike
) -> jax.Array:
    """The torque [J], `force - brake acc` with `brake = h kd`, clamped to the limit.

    Clamping comes last, or the damping would be that of a stronger joint.
    """
    return jnp.clip(
        force - jnp.asarray(brake) * acceleration, -jnp.asarray(limit), jnp.asarray(limit)
    )


def stable_pd(
    mass: jax.Array,
    bias: jax.Array,
    pos: jax.Array,
    vel: jax.Array,
    target: jax.Array,
    kp: jax.Array,
    kd: jax.Array,
    limit: jax.Array,
    step: float,
    dofs: jax.Array,
    constraint: jax.Array | float = 0.0,
) -> jax.Array:
    """Joint torques [J] in N·m of one creature.

    Args:
      mass: [nv, nv] and bias [nv] of the current state.
      pos, vel, target, kp, kd, limit: [J].
      step: h in s.
      dofs: [J] places of the joints among the degrees of freedom; the others have no gain.
      constraint: [nv] generalised constraint force, or none.
    """
    force = pd_force(pos, vel, target, kp, kd, step)
    full = jnp.zeros_like(bias).at[dofs].set(force) - bias + constraint
    damped = mass.at[dofs, dofs].add(step * kd)
    acceleration = jax.scipy.linalg.solve(damped, full, assume_a="pos")[dofs]
    return limited_torque(force, acceleration, step * kd, limit)
