"""Bar across the path, which the physics ignores, and the depth of a body in it."""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import forward_way
from mjxgait.creature.body import Body
from mjxgait.tasks.hop.limbo_config import BAR_PLACE, BAR_RADIUS
from mjxgait.types import Sensed

SLOPES = np.tan(np.radians(np.arange(-80, 81, 10))).astype(np.float32)[:, None]
"""Slopes [slopes, 1] of the lines that are laid on the body from above."""
MARGIN = 0.01
"""Required margin in m: decorative parts stick out of the watched geoms."""


def bar_distance(creature: Body, sensed: Sensed) -> jax.Array:
    """Distance [] in m to the bar along the start's forward axis; negative beyond it."""
    return BAR_PLACE - forward_way(creature, sensed)


def intrusion(creature: Body, sensed: Sensed, height: jax.Array | float) -> jax.Array:
    """Height [] in m of the body's hull above a bar of this height [] m, at the bar.

    The hull is that of the watched geoms, each taken as a ball of the same height; rods and springs
    that join them lie within. It is the space below all lines that rest on it from above, of which
    some are laid (`SLOPES`). Where they miss an edge, the hull is slightly too large. Flying over
    the bar counts no less than running into it. The floor must be the plane z = 0.
    """
    forward, _ = creature.frame.start_axes
    from_trunk = (sensed.geom_pos - sensed.trunk_pos) @ forward
    ahead, up = from_trunk - bar_distance(creature, sensed), sensed.geom_pos[:, 2]
    radius = up - sensed.geom_low + (BAR_RADIUS + MARGIN)
    lines = up - SLOPES * ahead + jnp.sqrt(1 + SLOPES**2) * radius
    top = jnp.min(jnp.max(lines, axis=1))
    return jnp.maximum(top - (height + BAR_RADIUS), 0.0)
