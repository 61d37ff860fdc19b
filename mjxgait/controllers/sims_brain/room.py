"""Overlap of a block with others, at rest."""

import jax
import jax.numpy as jnp

from mjxgait.types import pytree


@pytree
class Boxes:
    """Blocks at rest in the root's frame. middle, half: [..., 3] m. axes: [..., 3, 3] rows."""

    middle: jax.Array
    half: jax.Array
    axes: jax.Array


def inside(one: Boxes, others: Boxes) -> jax.Array:
    """Return the overlap depth [P] of one block with each other, over the smaller one's size.

    Negative if one of their six normals separates them (`physics.batched_trees.overlap`). A size is
    the cube root of a volume.
    """
    apart = others.middle - one.middle
    reach = jnp.abs(others.axes @ one.axes.T)  # [P, other's axis, own axis]
    own = one.half + jnp.einsum("pi,pij->pj", others.half, reach) - jnp.abs(apart @ one.axes.T)
    along = jnp.abs(jnp.einsum("pij,pj->pi", others.axes, apart))
    theirs = others.half + jnp.einsum("j,pij->pi", one.half, reach) - along
    depth = jnp.minimum(own, theirs).min(axis=1)
    return depth / jnp.minimum(size(one.half), size(others.half))


def size(half: jax.Array) -> jax.Array:
    """Return the cube root [...] in m of the volume of blocks with half sizes [..., 3]."""
    return 2 * jnp.cbrt(jnp.prod(half, axis=-1))
