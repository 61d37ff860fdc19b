"""Task protocol, and what tasks share: falls, scores, work, overlap."""

import math
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from typing import Protocol, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import optax

from mjxgait.config.schema import RolloutConfig
from mjxgait.controllers.observations import trunk_height
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends
from mjxgait.creature.settings import Termination
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed, pytree

FINISHED, NONFINITE = 0, -1
"""Reasons for the end of an episode: time was up, or numbers not finite. Tasks add their own."""


@pytree
class EpisodeStats:
    """Episode statistics common to all tasks; a task's own class adds fields.

    steps: [] until the end of the episode.
    reason: [] why the episode ended.
    overlap: [] m, deepest overlap of body parts at the moments that were checked.
    """

    steps: jax.Array
    reason: jax.Array
    overlap: jax.Array


Tally = EpisodeStats
"""Old name, for users' files."""
Settings_contra = TypeVar("Settings_contra", contravariant=True)
Goal = TypeVar("Goal")
TaskParams = TypeVar("TaskParams")
Stats = TypeVar("Stats", bound=EpisodeStats)


class Task(Protocol[Settings_contra, Goal, TaskParams, Stats]):
    """Task of one creature.

    Every method but `trials` is for one episode, and is mapped over lanes and episodes.
    """

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the fitness terms, in the order of storage."""
        ...

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of the metrics, in the order of storage."""
        ...

    @property
    def adds(self) -> tuple[str, ...]:
        """Names of the observations that the task adds."""
        ...

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """Draw the R trials [R, ...] that all individuals share; called once, by the host."""
        ...

    @property
    def has_curriculum(self) -> bool:
        """Curriculum flag: trials become harder as the best individuals pass them."""
        ...

    def levels(self, settings: Settings_contra) -> jax.Array | int:
        """Number [] of times that trials become harder."""
        ...

    def at_level(self, trials: Starts, settings: Settings_contra, level: jax.Array) -> Starts:
        """Return the trials [R, ...] at this level [] of the curriculum."""
        ...

    def level_passed(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """Return whether [] these terms, means over an individual's trials, allow harder trials."""
        ...

    def goal(self, trial: Starts) -> Goal:
        """Data of the trial besides the start: a goal, a light; () if none."""
        ...

    def params(self, settings: Settings_contra) -> TaskParams:
        """Task parameters that an episode keeps, plain or traced."""
        ...

    def observations(self, goal: Goal, sensed: Sensed) -> Mapping[str, jax.Array]:
        """Observations that the task adds, by name."""
        ...

    def next_goal(self, goal: Goal, sensed: Sensed) -> Goal:
        """Goal from the next step on."""
        ...

    def init(self) -> Stats:
        """Return the empty episode statistics."""
        ...

    def ended(self, sensed: Sensed, goal: Goal) -> jax.Array:
        """Reason [] to end the episode now; `FINISHED` continues it."""
        ...

    def update(
        self, stats: Stats, sensed: Sensed, torque: jax.Array, params: TaskParams, goal: Goal
    ) -> Stats:
        """Return the statistics after one more step under this torque [J] in N·m."""
        ...

    def evaluate(self, stats: Stats, settings: Settings_contra) -> Mapping[str, jax.Array]:
        """Fitness terms [] of an episode by name, each without unit and before its weight."""
        ...

    def outcome(self, stats: Stats) -> Mapping[str, jax.Array]:
        """Metrics by name, in m, s or counts; never a score converted back."""
        ...

    def weights(self, settings: Settings_contra, generation: jax.Array) -> Mapping[str, jax.Array]:
        """Weight of each term [] at a generation; penalties are negative."""
        ...


class Reason(IntEnum):
    """Reasons for the end of an episode."""

    FINISHED = FINISHED
    TIPPED = 1
    TOO_LOW = 2
    TOO_HIGH = 3
    TOUCHED = 4
    NONFINITE = NONFINITE


def why_fallen(creature: Body, limits: Termination | Ends, sensed: Sensed) -> jax.Array:
    """Return the `Reason` [] to end the episode now; `FINISHED` continues it."""
    up = (sensed.trunk_rot @ creature.frame.up.astype(np.float32))[2]
    height = trunk_height(sensed) / creature.frame.stand_height
    reason = jnp.zeros((), jnp.int32)
    if limits.touch:
        reason = jnp.where(touches(creature, sensed), Reason.TOUCHED, reason)
    reason = jnp.where(height > limits.height[1], Reason.TOO_HIGH, reason)
    reason = jnp.where(height < limits.height[0], Reason.TOO_LOW, reason)
    # Rounding may put an upside-down trunk below -1.
    tipped = (up < limits.min_up) & (limits.min_up > -1.0)
    return jnp.where(tipped, Reason.TIPPED, reason)


def touches(creature: Body, sensed: Sensed) -> jax.Array:
    """Return whether [] a part touches the floor that is neither foot nor ground contact."""
    others = sensed.geom_low[len(creature.feet.foot_of) :]
    return jnp.min(others, initial=1.0) < 0.0


def in_order(named: Mapping[str, jax.Array], names: Sequence[str]) -> jax.Array:
    """Stack named numbers [] in one array [F]."""
    return jnp.stack([jnp.asarray(named[name], jnp.float32) for name in names])


def score(
    terms: jax.Array, weights: jax.Array, worst: jax.Array | float, caution: float = 0.0
) -> jax.Array:
    """Fitness [...] of terms [..., R, F] under weights [F]; a value that is not finite scores -inf.

    A mix of the worst trial and the mean of the trials, minus `caution` standard errors of the
    mean.
    """
    trials = jnp.sum(terms * weights, axis=-1)
    value = worst * jnp.min(trials, axis=-1) + (1 - worst) * jnp.mean(trials, axis=-1)
    if caution:
        value = value - caution * jnp.std(trials, axis=-1) / math.sqrt(trials.shape[-1])
    return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def ramped(generations: jax.Array | int, generation: jax.Array) -> jax.Array:
    """Share [] of the full weight at a generation [].

    It grows from 0 to 1 over so many generations; 1 if over none.
    """
    whole = optax.linear_schedule(0.0, 1.0, 1)
    return ramp(generations, lambda now: whole(now / jnp.maximum(generations, 1)))(generation)


def hardness(steps: jax.Array | int, level: jax.Array) -> jax.Array:
    """Share [] of the full disturbances at a level [].

    It grows to 1 in so many steps; 1 if in none.
    """
    # The compiled quotient may miss 1 by a bit; a value rounded down would then never be complete.
    return ramp(steps, lambda now: (now + 1) / (steps + 1))(level)


def ramp(steps: jax.Array | float, rise: Callable[[jax.Array], jax.Array]) -> optax.Schedule:
    """Schedule that follows `rise` for so many steps and is 1 from there on.

    The number of steps may be traced, which `optax.linear_schedule` does not accept.
    """
    return optax.join_schedules([rise, optax.constant_schedule(1.0)], [steps])


def positive_work(torque: jax.Array, sensed: Sensed, step: float) -> jax.Array:
    """Work [] in J of all joints in one step of `step` s; braking gives none back.

    torque: [J] N·m.
    """
    return jnp.sum(jnp.maximum(torque * sensed.joint_vel, 0.0)) * step


def cost_of_transport(creature: Body, work: jax.Array, way: jax.Array) -> jax.Array:
    """Cost of transport []: work in J over the body's weight and a distance in m."""
    return work / (creature.frame.mass * 9.81 * way)


TOUCHING = 0.005
"""Hip heights; parts that overlap by less only touch."""
DEEP = 0.05
"""Hip heights beyond `TOUCHING` at which the cost is half of its limit.

The limit keeps an overlap from costing more than a walk earns.
"""


def crossed(creature: Body, overlap: jax.Array) -> jax.Array:
    """Cost of an overlap, 0 to 1. overlap: [] m, the deepest."""
    deeper = jnp.maximum(overlap / creature.frame.hip_height - TOUCHING, 0.0)
    return deeper / (deeper + DEEP)
