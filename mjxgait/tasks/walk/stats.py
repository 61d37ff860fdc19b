"""Episode statistics of a walk: running sums for one creature."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import CONTACT_GAP, foot_geoms, foot_heights
from mjxgait.creature.body import Body
from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.falls import touches
from mjxgait.tasks.terms import positive_work
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
        joints = self.creature.joints
        outside = (sensed.joint_pos < joints.pose_low.astype(np.float32)) | (
            sensed.joint_pos > joints.pose_high.astype(np.float32)
        )
        most = self.creature.gains.torque_limit.astype(np.float32)
        return WalkStats(
            steps=stats.steps + 1,
            reason=stats.reason,
            overlap=stats.overlap,
            touch=stats.touch + touches(self.creature, sensed),
            work=stats.work + positive_work(torque, sensed, self.step),
            saturation=stats.saturation + jnp.mean(jnp.abs(torque) >= most),
            limits=stats.limits + jnp.mean(outside),
            **self._trunk(stats, sensed),
            **self._feet(stats, sensed, clearance),
        )

    def _trunk(self, stats: WalkStats, sensed: Sensed) -> dict[str, jax.Array]:
        """Statistics of the trunk after one more step, by name."""
        frame = self.creature.frame
        start_forward, start_left = frame.start_axes
        moved = sensed.trunk_pos - frame.stand_pos.astype(np.float32)
        forward_axis = sensed.trunk_rot @ frame.forward.astype(np.float32)
        up = (sensed.trunk_rot @ frame.up.astype(np.float32))[2]
        forward = moved @ start_forward
        early = stats.steps + 1 <= self.half_time
        return {
            "forward": forward,
            "left": moved @ start_left,
            "forward_half": jnp.where(early, forward, stats.forward_half),
            "heading": jnp.arctan2(forward_axis @ start_left, forward_axis @ start_forward),
            "tilt": stats.tilt + 1.0 - up,
            "wobble": stats.wobble + sensed.trunk_angvel @ sensed.trunk_angvel,
        }

    def _feet(self, stats: WalkStats, sensed: Sensed, clearance: jax.Array) -> dict[str, jax.Array]:
        """Statistics of the feet after one more step, by name."""
        low, pos = self._places(sensed)
        down = (low < self.contact).astype(jnp.float32)
        # A foot that bears weight penetrates the floor a little.
        loaded = (low < 0.0).astype(jnp.float32)
        peak = jnp.maximum(stats.peak, low)
        missing = jnp.clip(1.0 - peak / jnp.maximum(clearance, 1e-6), 0.0, 1.0)
        went = jnp.linalg.norm(pos - stats.foot_pos, axis=1)
        speed = jnp.where(stats.steps > 0, jnp.max(went) / self.step, 0.0)
        rise = SWING * self.creature.frame.hip_height
        swinging = jnp.where(low > rise, 1.0, jnp.where(low < 0.5 * rise, 0.0, stats.swinging))
        fallen = jnp.maximum(stats.swinging - swinging, 0.0)
        return {
            "swings": stats.swings + fallen,
            "swinging": swinging,
            "shortfall": stats.shortfall + fallen * missing,
            "peak": jnp.where(fallen > 0, low, peak),
            "loaded": loaded,
            "touchdowns": stats.touchdowns + loaded * (1.0 - stats.loaded),
            "contact": stats.contact + down,
            "slip": stats.slip + went * down * stats.foot_down,
            "airborne": stats.airborne + (jnp.max(down) == 0.0),
            "foot_height": stats.foot_height + jnp.mean(low),
            "foot_speed": jnp.maximum(stats.foot_speed, speed),
            "foot_pos": pos,
            "foot_down": down,
        }

    def _places(self, sensed: Sensed) -> tuple[jax.Array, jax.Array]:
        """Lowest point [F] of each foot and its horizontal position [F, 2], mean of its geoms."""
        low = foot_heights(self.creature, sensed)
        pos = jnp.stack(
            [jnp.mean(sensed.geom_pos[g, :2], axis=0) for g in foot_geoms(self.creature)]
        )
        return low, pos
