"""Random numbers from one draw: each separate draw costs 0.25 s of compile time."""

import math
from collections.abc import Hashable, Mapping
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

Name = TypeVar("Name", bound=Hashable)
LEAST = 2.0**-24
"""Half of the smallest positive number that is drawn."""


def numbers(key: jax.Array, shapes: Mapping[Name, tuple[int, ...]]) -> dict[Name, jax.Array]:
    """Draw uniform numbers in [0, 1), by name, in these shapes."""
    ends = np.cumsum([math.prod(shape) for shape in shapes.values()])
    parts = jnp.split(jax.random.uniform(key, (int(ends[-1]),)), ends[:-1])
    return {n: part.reshape(shapes[n]) for n, part in zip(shapes, parts, strict=True)}


def between(uniform: jax.Array, bounds: tuple[float, float]) -> jax.Array:
    """Map [0, 1) to a range."""
    return bounds[0] + (bounds[1] - bounds[0]) * uniform


def numbered(uniform: jax.Array, count: int) -> jax.Array:
    """Map [0, 1) to the integers 0 to `count` - 1, all equally likely."""
    return jnp.floor(uniform * count).astype(jnp.int32)


def normal(uniform: jax.Array) -> jax.Array:
    """Map uniform numbers in [0, 1) to a normal distribution."""
    return math.sqrt(2) * jax.lax.erf_inv(2 * jnp.maximum(uniform, LEAST) - 1)
