"""Episode statistics of the tasks with a goal, updated once per step for one creature."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import forward_way, sideways
from mjxgait.creature.body import Body
from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.falls import touches
from mjxgait.tasks.hop.config import NEAR
from mjxgait.tasks.terms import positive_work
from mjxgait.types import Sensed, pytree

SLOW, SLOW_TURN = 0.0005, 0.005
"""m/s and rad/s; anything slower stands still."""


@pytree
class HopStats(EpisodeStats):
    """Statistics over the steps of an episode until it ends.

    reason: a `falls.Reason`.
    goal: [] m ahead of the start.
    left: [] m from the latest position to the goal along the start's forward axis, negative beyond
      it.
    aside: [] m to the left of the start, latest.
    arrived: [] steps until it first was near the goal; the length of an episode if it never was.
    after: [] m, path of the trunk since then.
    ground: [] steps on which a part touched the floor that must not.
    bent: [J] rad, distance of the joints from standing, latest.
    fastest: [] rad/s, of all joints.
    still: [] steps since the latest motion.
    work: [] J of the joints; None if it has no weight.
    closest: [U] m, smallest distance to each sub-goal; None without sub-goals.
    """

    goal: jax.Array
    left: jax.Array
    aside: jax.Array
    arrived: jax.Array
    after: jax.Array
    ground: jax.Array
    bent: jax.Array
    fastest: jax.Array
    still: jax.Array
    work: jax.Array | None
    closest: jax.Array | None


@pytree
class HopParams:
    """Task parameters of an episode.

    rest: [] steps without motion that end an episode; never if 0.
    """

    rest: jax.Array


def empty(creature: Body, horizon: int, energy: bool = False, sub_goals: int = 0) -> HopStats:
    """Return the statistics before any motion, whatever the goal.

    energy: whether work counts. sub_goals: their number.
    """
    none, zero, one = jnp.zeros((), jnp.int32), jnp.zeros(()), jnp.ones(())
    return HopStats(
        steps=none,
        reason=none,
        overlap=zero,
        goal=one,
        left=one,
        aside=zero,
        arrived=jnp.full((), horizon, jnp.int32),
        after=zero,
        ground=zero,
        bent=jnp.zeros(len(creature.joints.names)),
        fastest=zero,
        still=none,
        work=zero if energy else None,
        closest=jnp.full(sub_goals, jnp.inf) if sub_goals else None,
    )


def goal_distance(creature: Body, goal: jax.Array, sensed: Sensed) -> jax.Array:
    """Distance [] in m to the goal along the start's forward axis; positive when ahead."""
    return goal - forward_way(creature, sensed)


def distance(left: jax.Array, aside: jax.Array) -> jax.Array:
    """Distance [] in m in the plane to a goal, from its distances ahead and to the side."""
    return jnp.sqrt(left * left + aside * aside)


def away(stats: HopStats) -> jax.Array:
    """Distance [] in m from the latest position to the goal, measured in the plane."""
    return distance(stats.left, stats.aside)


def updated(
    creature: Body, step: float, stats: HopStats, sensed: Sensed, goal: jax.Array
) -> HopStats:
    """Return the statistics after one more step. step: s. goal: [] m."""
    left = goal_distance(creature, goal, sensed)
    aside = sideways(creature, sensed)
    near = distance(left, aside) <= NEAR * goal
    arrived = jnp.where(near, jnp.minimum(stats.arrived, stats.steps), stats.arrived)
    moved = jnp.linalg.norm(sensed.trunk_vel) * step
    return dataclasses.replace(
        stats,
        steps=stats.steps + 1,
        goal=goal,
        left=left,
        aside=aside,
        arrived=arrived,
        after=stats.after + jnp.where(arrived < stats.steps, moved, 0.0),
        ground=stats.ground + touches(creature, sensed),
        bent=jnp.abs(sensed.joint_pos - creature.joints.stand.astype(np.float32)),
        fastest=jnp.maximum(stats.fastest, jnp.max(jnp.abs(sensed.joint_vel), initial=0.0)),
        still=jnp.where(moves(sensed), 0, stats.still + 1),
    )


def with_extras(
    stats: HopStats, sensed: Sensed, torque: jax.Array, step: float, sub_goals: Sequence[float]
) -> HopStats:
    """Add the statistics that only some settings count: work, and distances to sub-goals.

    torque: [J] N·m. step: s. sub_goals: [U] shares of the straight way to the goal.
    """
    if stats.work is not None:
        done = stats.work + positive_work(torque, sensed, step)
        stats = dataclasses.replace(stats, work=done)
    if stats.closest is not None:
        way = stats.goal - stats.left
        apart = distance(jnp.array(sub_goals) * stats.goal - way, stats.aside)
        stats = dataclasses.replace(stats, closest=jnp.minimum(stats.closest, apart))
    return stats


def moves(sensed: Sensed) -> jax.Array:
    """Return whether [] there is visible motion."""
    turning = jnp.append(sensed.joint_vel, sensed.trunk_angvel)
    return (jnp.max(jnp.abs(sensed.trunk_vel)) > SLOW) | (jnp.max(jnp.abs(turning)) > SLOW_TURN)


def rested(stats: HopStats, horizon: int, rest: jax.Array, touching: jax.Array) -> HopStats:
    """Move the statistics to the end of the episode if nothing has moved for `rest` steps [].

    A `rest` of 0 never does. touching: [] whether a part is on the floor that must not.
    """
    over = (rest > 0) & (stats.still >= rest)
    left = jnp.where(over, horizon - stats.steps, 0)
    return dataclasses.replace(
        stats, steps=stats.steps + left, ground=stats.ground + left * touching
    )
