"""One episode: what its lane carries, how it begins, is disturbed, and ends."""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.controllers.spd import Rules
from mjxgait.tasks.base import EpisodeStats, Task
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import Starts
from mjxgait.types import BodyState, Sensed, pytree


@pytree
class Late:
    """Delayed torques. delay: [] control steps. recent: [D = rollout.latency, J], newest first."""

    delay: jax.Array
    recent: jax.Array


@pytree
class Lane:
    """One simulation in flight.

    place: [] in the device's queue. plan, memory: the controller's. stats, goal, params: the
    task's. rules: the drive's. push as in `Starts`.
    command: [J] the controller's latest; None where the controller acts in every step.
    late: None where torques are never delayed.
    """

    place: jax.Array
    body: BodyState
    plan: object
    memory: object
    stats: EpisodeStats
    goal: object
    params: object
    rules: Rules
    push: jax.Array
    push_step: jax.Array
    command: jax.Array | None = None
    late: Late | None = None


def first_body(start: Starts) -> BodyState:
    """Return the body at the start of an episode; start: of one trial, or of lanes."""
    still = jnp.zeros_like(start.qvel)
    return BodyState(
        start.qpos,
        start.qvel,
        warmstart=still,
        constraint_force=still,
        friction=start.friction,
        parameters=start.parameters,
        ground=start.ground,
    )


def reason_of(task: Task, sensed: Sensed, goal: object) -> jax.Array:
    """Return why [] a task's episode ends now; `Reason.FINISHED` while it goes on."""
    ended = task.ended(sensed, goal)
    seen = (sensed.joint_vel, sensed.trunk_pos, sensed.trunk_rot, sensed.bias)
    finite = jnp.isfinite(sum(jnp.sum(part) for part in seen))
    return jnp.where(finite, ended, Reason.NONFINITE).astype(jnp.int32)


def is_going(stats: EpisodeStats, steps: int) -> jax.Array:
    """Return whether [] an episode of so many steps has not ended."""
    return (stats.reason == Reason.FINISHED) & (stats.steps < steps)


def deepened(stats: EpisodeStats, depth: jax.Array, steps: int) -> EpisodeStats:
    """Return the statistics with an overlap of parts [] in m, if it is the deepest of an episode.

    A comparison, not a maximum: the next step handles a state that is NaN.
    """
    deeper = is_going(stats, steps) & (depth > stats.overlap)
    return dataclasses.replace(stats, overlap=jnp.where(deeper, depth, stats.overlap))


def pushed(body: BodyState, push: jax.Array, now: jax.Array) -> BodyState:
    """Return the state with a push [nv] added to its velocity, if it is due now []."""
    return dataclasses.replace(body, qvel=body.qvel + jnp.where(now, push, 0.0))


def arriving(late: Late, step: jax.Array, torque: jax.Array) -> tuple[jax.Array, Late]:
    """Return the torques [J] that arrive at a step [], and those still delayed.

    The latter include this step's own. Before the first torque arrives it already acts, as if the
    body had been held so.
    """
    known = jnp.concatenate([torque[None], jnp.where(step == 0, torque, late.recent)])
    arriving = torque
    for steps in range(1, len(known)):  # a lookup per lane would be slower
        arriving = jnp.where(late.delay == steps, known[steps], arriving)
    return arriving, Late(late.delay, known[:-1])
