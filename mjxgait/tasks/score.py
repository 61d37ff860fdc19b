"""From the terms of several trials to one number: higher is better."""

import math
from collections.abc import Callable, Mapping, Sequence

import jax
import jax.numpy as jnp
import optax


def in_order(named: Mapping[str, jax.Array], names: Sequence[str]) -> jax.Array:
    """Numbers [] by name as one array [F]."""
    return jnp.stack([jnp.asarray(named[name], jnp.float32) for name in names])


def score(
    terms: jax.Array, weights: jax.Array, worst: jax.Array | float, caution: float = 0.0
) -> jax.Array:
    """Fitness [...] of terms [..., R, F] under weights [F]; what is not finite scores -inf.

    A mix of the worst trial and the mean of the trials, less as many of the mean's standard errors as
    `caution` says.
    """
    trials = jnp.sum(terms * weights, axis=-1)
    value = worst * jnp.min(trials, axis=-1) + (1 - worst) * jnp.mean(trials, axis=-1)
    if caution:
        value = value - caution * jnp.std(trials, axis=-1) / math.sqrt(trials.shape[-1])
    return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def ramped(generations: jax.Array | int, generation: jax.Array) -> jax.Array:
    """Share [] of the full weight in a generation [] that grows from 0 to 1 over so many generations;
    1 if over none.
    """
    whole = optax.linear_schedule(0.0, 1.0, 1)
    return ramp(generations, lambda now: whole(now / jnp.maximum(generations, 1)))(generation)


def hardness(steps: jax.Array | int, level: jax.Array) -> jax.Array:
    """Share [] of the full disturbances that trials have at a level [], if these grow in so many steps;
    1 if in none.
    """
    # Compiled, the quotient need not be 1 to the bit, and what is cut to whole numbers would never be all.
    return ramp(steps, lambda now: (now + 1) / (steps + 1))(level)


def ramp(steps: jax.Array | float, rise: Callable[[jax.Array], jax.Array]) -> optax.Schedule:
    """Schedule that follows `rise` for so many steps and is 1 from there on.

    The number of steps may be a traced setting, which `optax.linear_schedule` does not accept.
    """
    return optax.join_schedules([rise, optax.constant_schedule(1.0)], [steps])
