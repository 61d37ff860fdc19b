"""Episode statistics of a walk: running sums for one creature, and those for walk targets.

A footfall phase is the middle of a foot's contact in cycles of the first foot, as in certification
(`certification.describe.footfall_phases`). A stance lasts from one swing to the next, because a
foot may lose contact for a moment after it comes down.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import (
    CONTACT_GAP,
    foot_geoms,
    foot_heights,
    sense,
    trunk_height,
)
from mjxgait.creature.body import Body
from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.falls import touches
from mjxgait.tasks.terms import positive_work
from mjxgait.tasks.walk.gaits import gait_of, placed
from mjxgait.types import Sensed, pytree

SWING = 0.03
"""Least height of a swing in hip heights; below it a foot only trembles. As in certification."""
PER_FOOT = (
    "swings",
    "swinging",
    "shortfall",
    "peak",
    "loaded",
    "touchdowns",
    "contact",
    "slip",
    "foot_down",
)
"""Fields with one value per foot."""


@pytree
class WalkStats(EpisodeStats):
    """Sums over the steps of an episode until it ends. `F` counts feet here, not their geoms.

    reason: a `falls.Reason`.
    forward, left: [] m from the start to the latest position.
    forward_half: [] m, `forward` at half time. heading: [] rad.
    swings: [F] completed swings.
    swinging: [F] 1 during a swing, which rises above `SWING` and ends in a footfall at half of it.
    shortfall: [F] missing clearance, share of the wanted, summed over swings.
    peak: [F] m, highest point since the latest footfall.
    loaded: [F] whether the foot bore weight on the previous step.
    touchdowns: [F] number of times the foot began to bear weight.
    contact: [F] steps in contact. slip: [F] m slid while in contact.
    airborne: [] steps without any foot on the floor.
    foot_height: [] m·steps, mean height of the feet.
    foot_speed: [] m/s, largest horizontal speed of any foot.
    foot_pos: [F, 2], foot_down: [F] of the previous step.
    tilt: [] of 1 - up.z. wobble: [] (rad/s)² of the trunk.
    touch: [] steps on which another part touches.
    work: [] J, positive.
    saturation, limits: [] share of joints at their torque limit, beyond their pose range.
    """

    forward: jax.Array
    left: jax.Array
    forward_half: jax.Array
    heading: jax.Array
    swings: jax.Array
    swinging: jax.Array
    shortfall: jax.Array
    peak: jax.Array
    loaded: jax.Array
    touchdowns: jax.Array
    contact: jax.Array
    slip: jax.Array
    airborne: jax.Array
    foot_height: jax.Array
    foot_speed: jax.Array
    foot_pos: jax.Array
    foot_down: jax.Array
    tilt: jax.Array
    wobble: jax.Array
    touch: jax.Array
    work: jax.Array
    saturation: jax.Array
    limits: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class StatsRecorder:
    """Accumulator of the episode statistics of one creature.

    half_time: step. contact: m above the floor below which a foot is down.
    """

    creature: Body
    step: float
    half_time: int
    contact: float = CONTACT_GAP

    def init(self) -> WalkStats:
        """Return the empty statistics."""
        feet = len(self.creature.feet.names)
        values = {field.name: jnp.zeros(()) for field in dataclasses.fields(WalkStats)}
        counts = {name: jnp.zeros((), jnp.int32) for name in ("steps", "reason")}
        per_foot = {name: jnp.zeros(feet) for name in PER_FOOT}
        return WalkStats(**(values | counts | per_foot | {"foot_pos": jnp.zeros((feet, 2))}))

    def update(
        self,
        stats: WalkStats,
        sensed: Sensed,
        torque: jax.Array,
        clearance: jax.Array,
    ) -> WalkStats:
        """Return the statistics after one more step.

        Args:
          torque: [J] N·m. clearance: [] m, wanted in each swing of each foot.
        """
        creature = self.creature
        start_forward, start_left = creature.frame.start_axes
        moved = sensed.trunk_pos - creature.frame.stand_pos.astype(np.float32)
        forward_axis = sensed.trunk_rot @ creature.frame.forward.astype(np.float32)
        up = (sensed.trunk_rot @ creature.frame.up.astype(np.float32))[2]
        low, pos = self._feet(sensed)
        down = (low < self.contact).astype(jnp.float32)
        # A foot that bears weight penetrates the floor a little.
        loaded = (low < 0.0).astype(jnp.float32)
        peak = jnp.maximum(stats.peak, low)
        missing = jnp.clip(1.0 - peak / jnp.maximum(clearance, 1e-6), 0.0, 1.0)
        went = jnp.linalg.norm(pos - stats.foot_pos, axis=1)
        slid = went * down * stats.foot_down
        speed = jnp.where(stats.steps > 0, jnp.max(went) / self.step, 0.0)
        rise = SWING * creature.frame.hip_height
        swinging = jnp.where(low > rise, 1.0, jnp.where(low < 0.5 * rise, 0.0, stats.swinging))
        fallen = jnp.maximum(stats.swinging - swinging, 0.0)
        outside = (sensed.joint_pos < creature.joints.pose_low.astype(np.float32)) | (
            sensed.joint_pos > creature.joints.pose_high.astype(np.float32)
        )
        steps = stats.steps + 1
        forward = moved @ start_forward
        return WalkStats(
            steps=steps,
            reason=stats.reason,
            forward=forward,
            left=moved @ start_left,
            forward_half=jnp.where(steps <= self.half_time, forward, stats.forward_half),
            heading=jnp.arctan2(forward_axis @ start_left, forward_axis @ start_forward),
            swings=stats.swings + fallen,
            swinging=swinging,
            shortfall=stats.shortfall + fallen * missing,
            peak=jnp.where(fallen > 0, low, peak),
            loaded=loaded,
            touchdowns=stats.touchdowns + loaded * (1.0 - stats.loaded),
            contact=stats.contact + down,
            slip=stats.slip + slid,
            airborne=stats.airborne + (jnp.max(down) == 0.0),
            foot_height=stats.foot_height + jnp.mean(low),
            foot_speed=jnp.maximum(stats.foot_speed, speed),
            foot_pos=pos,
            foot_down=down,
            tilt=stats.tilt + 1.0 - up,
            wobble=stats.wobble + sensed.trunk_angvel @ sensed.trunk_angvel,
            touch=stats.touch + touches(creature, sensed),
            work=stats.work + positive_work(torque, sensed, self.step),
            saturation=stats.saturation
            + jnp.mean(jnp.abs(torque) >= creature.gains.torque_limit.astype(np.float32)),
            limits=stats.limits + jnp.mean(outside),
            overlap=stats.overlap,
        )

    def _feet(self, sensed: Sensed) -> tuple[jax.Array, jax.Array]:
        """Lowest point [F] of each foot and its horizontal position [F, 2], mean of its geoms."""
        low = foot_heights(self.creature, sensed)
        pos = jnp.stack(
            [jnp.mean(sensed.geom_pos[g, :2], axis=0) for g in foot_geoms(self.creature)]
        )
        return low, pos


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


def along(before: TargetStats, after: TargetStats, told: jax.Array, half_time: int) -> TargetStats:
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
