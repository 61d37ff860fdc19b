"""What a way to a goal leaves behind, updated once per step for one creature."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.body import Body
from mjxgait.senses import forward_way
from mjxgait.settings.hop import NEAR
from mjxgait.tasks import protocol
from mjxgait.tasks.falls import touches
from mjxgait.types import Sensed, pytree


@pytree
class Tally(protocol.Tally):
    """Over the steps that a creature was up.

    reason: a `falls.Reason`. goal: [] m ahead of the start. left: [] m from the latest position to
    the goal, negative beyond it. arrived: [] steps until it first was near the goal; as many as an
    episode has if it never was. after: [] m, path of the trunk since then.
    ground: [] steps on which a part touched the floor that must not. bent: [J] rad, how far the
    joints are from standing, latest.
    """

    goal: jax.Array
    left: jax.Array
    arrived: jax.Array
    after: jax.Array
    ground: jax.Array
    bent: jax.Array


def empty(creature: Body, horizon: int) -> Tally:
    """Of one that has not moved, whatever its goal."""
    none, zero, one = jnp.zeros((), jnp.int32), jnp.zeros(()), jnp.ones(())
    return Tally(
        steps=none,
        reason=none,
        overlap=zero,
        goal=one,
        left=one,
        arrived=jnp.full((), horizon, jnp.int32),
        after=zero,
        ground=zero,
        bent=jnp.zeros(len(creature.joints.names)),
    )


def goal_distance(creature: Body, goal: jax.Array, sensed: Sensed) -> jax.Array:
    """From the trunk to the goal [] in m along the start's forward axis; positive when ahead."""
    return goal - forward_way(creature, sensed)


def updated(creature: Body, step: float, tally: Tally, sensed: Sensed, goal: jax.Array) -> Tally:
    """The tally after one more step in s. goal: [] m."""
    left = goal_distance(creature, goal, sensed)
    near = jnp.abs(left) <= NEAR * goal
    arrived = jnp.where(near, jnp.minimum(tally.arrived, tally.steps), tally.arrived)
    moved = jnp.linalg.norm(sensed.trunk_vel) * step
    return dataclasses.replace(
        tally,
        steps=tally.steps + 1,
        goal=goal,
        left=left,
        arrived=arrived,
        after=tally.after + jnp.where(arrived < tally.steps, moved, 0.0),
        ground=tally.ground + touches(creature, sensed),
        bent=jnp.abs(sensed.joint_pos - creature.joints.stand.astype(np.float32)),
    )
