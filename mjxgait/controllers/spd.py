"""Stable proportional-derivative control (Tan, Liu & Turk 2011, eq. 12).

"Stable proportional-derivative controllers" in two elementwise parts, for one creature or a batch.
The solve with `M + h diag(kd)` between them needs the mass matrix; `drive.Drive.torque` joins all
three.
"""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike


def pd_force(
    pos: jax.Array, vel: jax.Array, target: jax.Array, kp: ArrayLike, kd: ArrayLike, step: ArrayLike
) -> jax.Array:
    """Return the PD force at the end of the step: `-kp (q + h v - target) - kd v` in N·m.

    All [J]; step in s, 0 gives plain PD.
    """
    return -jnp.asarray(kp) * (pos + step * vel - target) - jnp.asarray(kd) * vel


def limited_torque(
    force: jax.Array, acceleration: jax.Array, brake: ArrayLike, limit: ArrayLike
) -> jax.Array:
    """Return the torque [J]: `force - brake acc` with `brake = h kd`, clamped to the limit.

    Clamping comes last; otherwise the damping would be that of a stronger joint.
    """
    return jnp.clip(
        force - jnp.asarray(brake) * acceleration, -jnp.asarray(limit), jnp.asarray(limit)
    )
