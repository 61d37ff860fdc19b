"""Arithmetic that fitness terms share: scores, ramps of weights and trials, work, overlap."""

import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import optax

from mjxgait.creature.body import Body
from mjxgait.types import Sensed


def score(
    terms: jax.Array, weights: jax.Array, worst: jax.Array | float, caution: float = 0.0
) -> jax.Array:
    """Fitness [...] of terms [..., R, F] under weights [F]; a value that is not finite scores -inf.

    A mix of the worst trial and the mean of the trials, minus `caution` standard errors of the
    mean.
    """
    trials = jnp.sum(terms * weights, axis=-1)
    value = worst * jnp.min(trials, axis=-1) + (1 - worst) * jnp.mean(trials, axis=-1)
    if caution:
        value = value - caution * jnp.std(trials, axis=-1) / math.sqrt(trials.shape[-1])
    return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def ramped(generations: jax.Array | int, generation: jax.Array) -> jax.Array:
    """Share [] of the full weight at a generation [].

    It grows from 0 to 1 over so many generations; 1 if over none.
    """
    whole = optax.linear_schedule(0.0, 1.0, 1)
    return ramp(generations, lambda now: whole(now / jnp.maximum(generations, 1)))(generation)


def hardness(steps: jax.Array | int, level: jax.Array) -> jax.Array:
    """Share [] of the full disturbances at a level [].

    It grows to 1 in so many steps; 1 if in none.
    """
    # The compiled quotient may miss 1 by a bit; a value rounded down would then never be complete.
    return ramp(steps, lambda now: (now + 1) / (steps + 1))(level)


def ramp(steps: jax.Array | float, rise: Callable[[jax.Array], jax.Array]) -> optax.Schedule:
    """Schedule that follows `rise` for so many steps and is 1 from there on.

    The number of steps may be traced, which `optax.linear_schedule` does not accept.
    """
    return optax.join_schedules([rise, optax.constant_schedule(1.0)], [steps])


def positive_work(torque: jax.Array, sensed: Sensed, step: float) -> jax.Array:
    """Work [] in J of all joints in one step of `step` s; braking gives none back.

    torque: [J] N·m.
    """
    return jnp.sum(jnp.maximum(torque * sensed.joint_vel, 0.0)) * step


def cost_of_transport(creature: Body, work: jax.Array, way: jax.Array) -> jax.Array:
    """Cost of transport []: work in J over the body's weight and a distance in m."""
    return work / (creature.frame.mass * 9.81 * way)


TOUCHING = 0.005
"""Hip heights; parts that overlap by less only touch."""
DEEP = 0.05
"""Hip heights beyond `TOUCHING` at which the cost is half of its limit.

The limit keeps an overlap from costing more than a walk earns.
"""


def overlap_cost(creature: Body, overlap: jax.Array) -> jax.Array:
    """Cost of an overlap, 0 to 1. overlap: [] m, the deepest."""
    deeper = jnp.maximum(overlap / creature.frame.hip_height - TOUCHING, 0.0)
    return deeper / (deeper + DEEP)
