"""When the feet stand, against each other: the phases by which a gait has its name.

A phase is the middle of a foot's contact in cycles of the first foot, as the examiner has it
(`certify.describe.footfall_phases`); a stance is what lies between two swings, for a foot that
comes down may come off again for a moment.
"""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.tasks.walk.gaits import gait_of, placed
from mjxgait.tasks.walk.stats import Tally
from mjxgait.types import pytree

SPARE = 0.03
"""Duty factor by which a gait should be away from the end of its range."""
SHARP = 0.1
"""Mean deviation at which a gait counts as half missed; an eighth of a cycle is 0.15 of it."""


@pytree
class Footfalls:
    """Sums over the stances that have ended, the first of each foot left out. `F` feet.

    landed: [F] whether it has come down from a swing yet. pressed, when: [F] steps with contact in
    the stance that goes on, and their times summed. middle: [F] step, mean of those of the latest
    stance that has ended.
    period: [] steps between the middles of the first foot's latest two stances; 0 before them.
    cosine, sine: [F] of the phases, summed. stances: [F].
    """

    landed: jax.Array
    pressed: jax.Array
    when: jax.Array
    middle: jax.Array
    period: jax.Array
    cosine: jax.Array
    sine: jax.Array
    stances: jax.Array


def no_footfalls(feet: int) -> Footfalls:
    """Before the first step."""
    each = jnp.zeros(feet)
    return Footfalls(each, each, each, each, jnp.zeros(()), each, each, each)


def stepped(falls: Footfalls, before: Tally, after: Tally) -> Footfalls:
    """One step more: the tally before and after it says who has come down, and who has risen."""
    now = after.steps.astype(jnp.float32)
    # A first stance began before the episode did.
    came = (before.swinging > 0) & (after.swinging == 0)
    landed = jnp.where(came, 1.0, falls.landed)
    rose = (before.swinging == 0) & (after.swinging > 0) & (falls.pressed > 0)
    middle = jnp.where(rose, falls.when / jnp.maximum(falls.pressed, 1.0), falls.middle)
    on = landed * after.foot_down * (after.swinging == 0)
    passed = jnp.where(falls.middle[0] > 0, middle[0] - falls.middle[0], 0.0)
    period = jnp.where(rose[0], passed, falls.period)
    told = rose & (period > 0)
    angle = 2 * jnp.pi * (middle - middle[0]) / jnp.maximum(period, 1.0)
    return Footfalls(
        landed=landed,
        pressed=jnp.where(rose, 0.0, falls.pressed + on),
        when=jnp.where(rose, 0.0, falls.when + on * now),
        middle=middle,
        period=period,
        cosine=falls.cosine + jnp.where(told, jnp.cos(angle), 0.0),
        sine=falls.sine + jnp.where(told, jnp.sin(angle), 0.0),
        stances=falls.stances + told,
    )


def gait_missed(
    name: str, stations: tuple[tuple[int, bool], ...], falls: Footfalls, duty: jax.Array
) -> jax.Array:
    """How far [] the footfalls are from those of a gait, 0 to 1.

    Of each foot half of 1 - cos of what its phases are off, averaged over its stances; a foot that
    stands less often than the others is off in what is missing. Halved where it is `SHARP`, plus
    what the mean duty factor is beyond its range.

    Args:
      stations: where the feet are. duty: [F] duty factors.
    """
    gait = gait_of(name, len(stations))
    ways = 2 * np.pi * np.array(placed(gait, stations), np.float32)
    ways = ways - ways[:, :1]
    # Two stances more or less are how an episode begins and ends.
    due = jnp.maximum(jnp.max(falls.stances) - 2.0, 1.0)
    hits = falls.cosine * np.cos(ways) + falls.sine * np.sin(ways)
    hits = hits / jnp.maximum(falls.stances, due)
    off = jnp.min(jnp.mean(0.5 * (1.0 - hits), axis=1))
    low, high = gait.duty
    low, high = (low + SPARE if low > 0 else low), (high - SPARE if high < 1 else high)
    mean = jnp.mean(duty)
    beyond = jnp.maximum(low - mean, 0.0) + jnp.maximum(mean - high, 0.0)
    off = off + beyond
    return off / (off + SHARP)
