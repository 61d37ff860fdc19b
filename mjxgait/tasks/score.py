"""From the terms of several trials to one number: higher is better."""

import math
from collections.abc import Mapping, Sequence

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
    """From 0 to 1, what of its full weight counts in a generation [] if that grows over so many; all of
    it at once if over none.
    """
    grown = optax.linear_schedule(0.0, 1.0, 1)(generation / jnp.maximum(generations, 1))
    return jnp.where(jnp.asarray(generations) > 0, grown, 1.0)


def hardness(steps: jax.Array | int, level: jax.Array) -> jax.Array:
    """Up to 1, the share [] of what trials will ask for that they ask for at a level [], if that grows in
    so many steps; all of it if in none.
    """
    # Compiled, the quotient need not be 1 to the bit, and what is cut to whole numbers would never be all.
    return jnp.where(level < steps, (level + 1) / (steps + 1), 1.0)
