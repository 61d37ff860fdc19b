"""What an episode leaves behind of a walk of which more is asked, besides what every walk does."""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.body import Body
from mjxgait.senses import sense, trunk_height
from mjxgait.tasks.walk.footfalls import Footfalls, no_footfalls, stepped
from mjxgait.tasks.walk.tally import Tally
from mjxgait.types import Sensed, pytree


@pytree
class WishTally(Tally):
    """See `Tally`.

    falls: the footfalls. height, height_squared: [] m·steps, m²·steps of the trunk. roll_squared:
    [] rad²·steps of its roll.
    trunk: [2] m, where the trunk was, forward and left of the start.
    """

    falls: Footfalls
    height: jax.Array
    height_squared: jax.Array
    roll_squared: jax.Array
    trunk: jax.Array


def wish_tally(tally: Tally, feet: int) -> WishTally:
    """The empty one over an empty tally."""
    none = jnp.zeros(())
    return WishTally(
        **vars(tally),
        falls=no_footfalls(feet),
        height=none,
        height_squared=none,
        roll_squared=none,
        trunk=jnp.zeros(2),
    )


def wish_updated(creature: Body, before: WishTally, after: Tally, sensed: Sensed) -> WishTally:
    """The tally after one step more, of which `after` has what every walk leaves behind."""
    height = trunk_height(sensed)
    way = sense(creature, sensed, jnp.zeros(()), ["roll", "forward", "aside"])
    return WishTally(
        **vars(after),
        falls=stepped(before.falls, before, after),
        height=before.height + height,
        height_squared=before.height_squared + height**2,
        roll_squared=before.roll_squared + way["roll"] ** 2,
        trunk=jnp.stack([way["forward"], way["aside"]]),
    )


def along(before: WishTally, after: WishTally, told: jax.Array, half_time: int) -> WishTally:
    """The tally after a step with its way along the heading [] in rad that was told then.

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
    """The same direction [] from -pi to pi."""
    return jnp.arctan2(jnp.sin(angle), jnp.cos(angle))
