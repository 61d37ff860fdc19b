"""Work of the joints, and the cost of transport."""

import jax
import jax.numpy as jnp

from mjxgait.creature.body import Body
from mjxgait.types import Sensed


def positive_work(torque: jax.Array, sensed: Sensed, step: float) -> jax.Array:
    """Work [] in J of all joints in one step of `step` s; braking gives none back.

    torque: [J] N·m.
    """
    return jnp.sum(jnp.maximum(torque * sensed.joint_vel, 0.0)) * step


def cost_of_transport(creature: Body, work: jax.Array, way: jax.Array) -> jax.Array:
    """Cost of transport []: work in J over the body's weight and a distance in m."""
    return work / (creature.frame.mass * 9.81 * way)
