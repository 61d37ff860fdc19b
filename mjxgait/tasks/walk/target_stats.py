"""Additional episode statistics of a walk with targets."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import sense, trunk_height
from mjxgait.creature.body import Body
from mjxgait.tasks.walk.footfalls import Footfalls, no_footfalls, stepped
from mjxgait.tasks.walk.stats import Tally
from mjxgait.types import Sensed, pytree


@pytree
class WishTally(Tally):
    """See `Tally`.

    falls: the footfalls.
    height, height_squared: [] m·steps, m²·steps of the trunk.
    roll_squared: [] rad²·steps of the trunk's roll.
    pitch: [] rad·steps of the nose below the horizon.
    reach: [F] m·steps in contact, distance of a foot ahead of where it stands at rest.
    trunk: [2] m, position of the trunk forward and left of the start.
    """

    falls: Footfalls
    height: jax.Array
    height_squared: jax.Array
    roll_squared: jax.Array
    pitch: jax.Array
    reach: jax.Array
    trunk: jax.Array


def wish_tally(tally: Tally, feet: int) -> WishTally:
    """Extend empty statistics by the empty ones of the targets."""
    none = jnp.zeros(())
    return WishTally(
        **vars(tally),
        falls=no_footfalls(feet),
        height=none,
        height_squared=none,
        roll_squared=none,
        pitch=none,
        reach=jnp.zeros(feet),
        trunk=jnp.zeros(2),
    )


def wish_updated(creature: Body, before: WishTally, after: Tally, sensed: Sensed) -> WishTally:
    """Return the statistics after one more step; `after` holds those of every walk."""
    height = trunk_height(sensed)
    reads = ["roll", "pitch", "forward", "aside", "foot_place"]
    way = sense(creature, sensed, jnp.zeros(()), reads)
    ahead = (way["foot_place"] - creature.feet.places.astype(np.float32))[:, 0]
    return WishTally(
        **vars(after),
        falls=stepped(before.falls, before, after),
        height=before.height + height,
        height_squared=before.height_squared + height**2,
        roll_squared=before.roll_squared + way["roll"] ** 2,
        pitch=before.pitch + way["pitch"],
        reach=before.reach + ahead * after.foot_down,
        trunk=jnp.stack([way["forward"], way["aside"]]),
    )


def along(before: WishTally, after: WishTally, told: jax.Array, half_time: int) -> WishTally:
    """Return `after` with distances along the commanded heading [] in rad.

    half_time: step.
    """
    ahead, left = jnp.cos(told), jnp.sin(told)
    x, y = after.trunk - before.trunk
    forward = before.forward + x * ahead + y * left
    early = after.steps <= half_time
    return dataclasses.replace(
        after,
        forward=forward,
        left=before.left - x * left + y * ahead,
        forward_half=jnp.where(early, forward, before.forward_half),
        heading=wrapped(after.heading - told),
    )


def wrapped(angle: jax.Array) -> jax.Array:
    """Angle [] wrapped to the range from -pi to pi."""
    return jnp.arctan2(jnp.sin(angle), jnp.cos(angle))
