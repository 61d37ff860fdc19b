"""Trees in prefix order as arrays: helpers of the operators.

A tree is `code` [C] and `value` [C] (`text`); beyond its end both are zero.
"""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.expressions.text import (
    ARITY,
    CONSTANT,
    EMPTY,
    FIRST_ADDED,
)
from mjxgait.types import pytree


@pytree
class Trees:
    """Trees, one per joint. code: [J, C] integers. value: [J, C] of constants, else zero."""

    code: jax.Array
    value: jax.Array


def arity(code: jax.Array) -> jax.Array:
    """Return the number of arguments [...] of each node."""
    taken = jnp.asarray(ARITY)[jnp.minimum(code, FIRST_ADDED - 1)]
    return jnp.where(code < FIRST_ADDED, taken, 0)


def size(code: jax.Array) -> jax.Array:
    """Return the number of nodes [] of a tree [C]."""
    return jnp.sum(code != EMPTY)


def subtree_sizes(code: jax.Array) -> jax.Array:
    """Return the number of nodes [C] of the subtree at each place; 0 beyond the end."""
    places = np.arange(code.shape[0])
    used = code != EMPTY
    # A subtree ends when all its arguments are complete.
    wanted = jnp.cumsum(jnp.where(used, arity(code) - 1, 0))
    before = wanted - jnp.where(used, arity(code) - 1, 0)
    complete = (wanted[None, :] - before[:, None] == -1) & (places[None, :] >= places[:, None])
    return jnp.where(used, jnp.argmax(complete, axis=1) - places + 1, 0)


def depths(code: jax.Array) -> jax.Array:
    """Return the depth [C] of each node: its number of enclosing functions."""
    places, sizes = np.arange(code.shape[0]), subtree_sizes(code)
    start, node = places[:, None], places[None, :]
    within = (start < node) & (node < start + sizes[:, None])
    return jnp.sum(within & (code != EMPTY)[None, :], axis=0)


def canonical(code: jax.Array, value: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return code and value with zeros for values that have no meaning."""
    return code, jnp.where(code == CONSTANT, value, 0.0)
