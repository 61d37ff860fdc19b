"""Chance, many numbers of one draw: every draw of its own costs the compiler a quarter of a second."""

import math
from collections.abc import Hashable, Mapping
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

Name = TypeVar("Name", bound=Hashable)
LEAST = 2.0**-24
"""Half of what lies between zero and the next number that is drawn."""


def numbers(key: jax.Array, shapes: Mapping[Name, tuple[int, ...]]) -> dict[Name, jax.Array]:
    """Uniform ones in [0, 1), by name and in these shapes."""
    ends = np.cumsum([math.prod(shape) for shape in shapes.values()])
    parts = jnp.split(jax.random.uniform(key, (int(ends[-1]),)), ends[:-1])
    return {n: part.reshape(shapes[n]) for n, part in zip(shapes, parts, strict=True)}


def between(uniform: jax.Array, bounds: tuple[float, float]) -> jax.Array:
    """From [0, 1) to a range."""
    return bounds[0] + (bounds[1] - bounds[0]) * uniform


def numbered(uniform: jax.Array, count: int) -> jax.Array:
    """From [0, 1) to whole numbers from 0 on, all alike."""
    return jnp.floor(uniform * count).astype(jnp.int32)


def normal(uniform: jax.Array) -> jax.Array:
    """From [0, 1) to a normal distribution."""
    return math.sqrt(2) * jax.lax.erf_inv(2 * jnp.maximum(uniform, LEAST) - 1)
