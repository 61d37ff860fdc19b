"""Falls: why an episode ends before its time."""

from enum import IntEnum

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import trunk_height
from mjxgait.creature.body import Body, Ends
from mjxgait.creature.settings import Termination
from mjxgait.types import Sensed


class Reason(IntEnum):
    """Reasons for the end of an episode; tasks add their own.

    FINISHED: time was up. NONFINITE: numbers were not finite.
    """

    FINISHED = 0
    TIPPED = 1
    TOO_LOW = 2
    TOO_HIGH = 3
    TOUCHED = 4
    NONFINITE = -1


def why_fallen(creature: Body, limits: Termination | Ends, sensed: Sensed) -> jax.Array:
    """Return the `Reason` [] to end the episode now; `FINISHED` continues it."""
    up = (sensed.trunk_rot @ creature.frame.up.astype(np.float32))[2]
    height = trunk_height(sensed) / creature.frame.stand_height
    reason = jnp.zeros((), jnp.int32)
    if limits.touch:
        reason = jnp.where(touches(creature, sensed), Reason.TOUCHED, reason)
    reason = jnp.where(height > limits.height[1], Reason.TOO_HIGH, reason)
    reason = jnp.where(height < limits.height[0], Reason.TOO_LOW, reason)
    # Rounding may put an upside-down trunk below -1.
    tipped = (up < limits.min_up) & (limits.min_up > -1.0)
    return jnp.where(tipped, Reason.TIPPED, reason)


def touches(creature: Body, sensed: Sensed) -> jax.Array:
    """Return whether [] a part touches the floor that is neither foot nor ground contact."""
    others = sensed.geom_low[len(creature.feet.foot_of) :]
    return jnp.min(others, initial=1.0) < 0.0
