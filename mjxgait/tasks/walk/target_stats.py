"""Episode statistics for the targets of a walk: footfalls, posture, the way along a heading.

A footfall phase is the middle of a foot's contact in cycles of the first foot, as in certification
(`certification.describe.footfall_phases`). A stance lasts from one swing to the next, because a
foot may lose contact for a moment after it comes down.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import sense, trunk_height
from mjxgait.creature.body import Body
from mjxgait.tasks.walk.gaits import gait_of, placed
from mjxgait.tasks.walk.stats import WalkStats
from mjxgait.types import Sensed, pytree

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


def stepped(falls: Footfalls, before: WalkStats, after: WalkStats) -> Footfalls:
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
    counts = rose & (period > 0)
    angle = 2 * jnp.pi * (middle - middle[0]) / jnp.maximum(period, 1.0)
    return Footfalls(
        landed=landed,
        pressed=jnp.where(rose, 0.0, falls.pressed + on),
        when=jnp.where(rose, 0.0, falls.when + on * now),
        middle=middle,
        period=period,
        cosine=falls.cosine + jnp.where(counts, jnp.cos(angle), 0.0),
        sine=falls.sine + jnp.where(counts, jnp.sin(angle), 0.0),
        stances=falls.stances + counts,
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


@pytree
class TargetStats(WalkStats):
    """Extension of `WalkStats`.

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


def target_stats(stats: WalkStats, feet: int) -> TargetStats:
    """Extend empty statistics by the empty ones of the targets."""
    none = jnp.zeros(())
    return TargetStats(
        **vars(stats),
        falls=no_footfalls(feet),
        height=none,
        height_squared=none,
        roll_squared=none,
        pitch=none,
        reach=jnp.zeros(feet),
        trunk=jnp.zeros(2),
    )


def target_updated(
    creature: Body, before: TargetStats, after: WalkStats, sensed: Sensed
) -> TargetStats:
    """Return the statistics after one more step; `after` holds those of every walk."""
    height = trunk_height(sensed)
    reads = ["roll", "pitch", "forward", "aside", "foot_place"]
    way = sense(creature, sensed, jnp.zeros(()), reads)
    ahead = (way["foot_place"] - creature.feet.places.astype(np.float32))[:, 0]
    return TargetStats(
        **vars(after),
        falls=stepped(before.falls, before, after),
        height=before.height + height,
        height_squared=before.height_squared + height**2,
        roll_squared=before.roll_squared + way["roll"] ** 2,
        pitch=before.pitch + way["pitch"],
        reach=before.reach + ahead * after.foot_down,
        trunk=jnp.stack([way["forward"], way["aside"]]),
    )


def along(
    before: TargetStats, after: TargetStats, commanded: jax.Array, half_time: int
) -> TargetStats:
    """Return `after` with distances along the commanded heading [] in rad.

    half_time: step.
    """
    ahead, left = jnp.cos(commanded), jnp.sin(commanded)
    x, y = after.trunk - before.trunk
    forward = before.forward + x * ahead + y * left
    early = after.steps <= half_time
    return dataclasses.replace(
        after,
        forward=forward,
        left=before.left - x * left + y * ahead,
        forward_half=jnp.where(early, forward, before.forward_half),
        heading=wrapped(after.heading - commanded),
    )


def wrapped(angle: jax.Array) -> jax.Array:
    """Angle [] wrapped to the range from -pi to pi."""
    return jnp.arctan2(jnp.sin(angle), jnp.cos(angle))
