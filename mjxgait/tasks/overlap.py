"""Cost of overlapping body parts, the same for every task on a floor."""

import jax
import jax.numpy as jnp

from mjxgait.creature.body import Body

TOUCHING = 0.005
"""Hip heights; parts that overlap by less only touch."""
DEEP = 0.05
"""Hip heights beyond `TOUCHING` at which the cost is half of its limit.

The limit keeps an overlap from costing more than a walk earns.
"""


def crossed(creature: Body, overlap: jax.Array) -> jax.Array:
    """Cost of an overlap, 0 to 1. overlap: [] m, the deepest."""
    deeper = jnp.maximum(overlap / creature.frame.hip_height - TOUCHING, 0.0)
    return deeper / (deeper + DEEP)
