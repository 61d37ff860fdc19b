"""Task protocol, and the statistics that all tasks have."""

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

import jax
import jax.numpy as jnp

from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed, pytree


@pytree
class EpisodeStats:
    """Episode statistics common to all tasks; a task's own class adds fields.

    steps: [] until the end of the episode.
    reason: [] why the episode ended, a `falls.Reason` or one of the task's own.
    overlap: [] m, deepest overlap of body parts at the moments that were checked.
    """

    steps: jax.Array
    reason: jax.Array
    overlap: jax.Array


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
        """Reason [] to end the episode now; `Reason.FINISHED` continues it."""
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


def in_order(named: Mapping[str, jax.Array], names: Sequence[str]) -> jax.Array:
    """Stack named numbers [] in one array [F]."""
    return jnp.stack([jnp.asarray(named[name], jnp.float32) for name in names])
