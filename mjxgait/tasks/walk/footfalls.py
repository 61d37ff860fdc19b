"""Footfall phases: the relative timing of stances, which defines a gait.

A phase is the middle of a foot's contact in cycles of the first foot, as in certification
(`certification.describe.footfall_phases`). A stance lasts from one swing to the next, because a
foot may lose contact for a moment after it comes down.
"""

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.tasks.walk.gaits import gait_of, placed
from mjxgait.tasks.walk.stats import Tally
from mjxgait.types import pytree

SPARE = 0.03
"""Margin in duty factor that a gait should keep from the ends of its range."""
SHARP = 0.1
"""Mean deviation at which a gait counts as half missed; an eighth of a cycle deviates by 0.15."""


@pytree
class Footfalls:
    """Sums over completed stances, without the first of each foot. `F` feet.

    landed: [F] 1 once the foot has come down from a swing.
    pressed, when: [F] steps with contact in the current stance, and the sum of their times.
    middle: [F] mean step of the latest completed stance.
    period: [] steps between the middles of the first foot's latest two stances; 0 before them.
    cosine, sine: [F] of the phases, summed.
    stances: [F] number of stances.
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
    """Return the sums before the first step."""
    each = jnp.zeros(feet)
    return Footfalls(each, each, each, each, jnp.zeros(()), each, each, each)


def stepped(falls: Footfalls, before: Tally, after: Tally) -> Footfalls:
    """Advance by one step; the statistics before and after it show which feet landed or lifted."""
    now = after.steps.astype(jnp.float32)
    # The first stance began before the episode.
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
    """Deviation [] of the footfalls from those of a gait, 0 to 1.

    A foot deviates by half of 1 - cos of its phase error, averaged over its stances; a missing
    stance counts half. The mean over the feet, plus the excess of the mean duty factor over its
    range, is mapped to 0 to 1, with 0.5 at `SHARP`.

    Args:
      stations: places of the feet. duty: [F] duty factors.
    """
    gait = gait_of(name, len(stations))
    ways = 2 * np.pi * np.array(placed(gait, stations), np.float32)
    ways = ways - ways[:, :1]
    # The start and end of an episode may change the count by two stances.
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
