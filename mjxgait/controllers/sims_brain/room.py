"""Whether there is room for a block among others."""

import jax
import jax.numpy as jnp

from mjxgait.types import pytree


@pytree
class Boxes:
    """Blocks at rest, in the root's frame, [..., 3] each. middle, half: m. axes: [..., 3, 3] rows."""

    middle: jax.Array
    half: jax.Array
    axes: jax.Array


def inside(one: Boxes, others: Boxes) -> jax.Array:
    """How deep [P] one block and each of the others are in each other, of the smaller one's size.

    Negative where one of their six normals separates them (`physics.trees.overlap`); a size is the
    cube root of a volume.
    """
    apart = others.middle - one.middle
    reach = jnp.abs(others.axes @ one.axes.T)  # [P, other's axis, own axis]
    own = one.half + jnp.einsum("pi,pij->pj", others.half, reach) - jnp.abs(apart @ one.axes.T)
    along = jnp.abs(jnp.einsum("pij,pj->pi", others.axes, apart))
    theirs = others.half + jnp.einsum("j,pij->pi", one.half, reach) - along
    depth = jnp.minimum(own, theirs).min(axis=1)
    return depth / jnp.minimum(size(one.half), size(others.half))


def size(half: jax.Array) -> jax.Array:
    """[...] m, the cube root of the volume of blocks with half sizes [..., 3]."""
    return 2 * jnp.cbrt(jnp.prod(half, axis=-1))
