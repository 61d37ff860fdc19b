"""Task protocol: the contract with rollout and evolution, common to walking, hopping, swimming."""

from collections.abc import Mapping
from typing import Any, Protocol

import jax

from mjxgait.config.rollout import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed, pytree

FINISHED, NONFINITE = 0, -1
"""Reasons for the end of an episode: time was up, or numbers not finite. Tasks add their own."""


@pytree
class Tally:
    """Episode statistics common to all tasks; a task's own class adds fields.

    steps: [] until the end of the episode.
    reason: [] why the episode ended.
    overlap: [] m, deepest overlap of body parts at the moments that were checked.
    """

    steps: jax.Array
    reason: jax.Array
    overlap: jax.Array


class Task(Protocol):
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
    def climbs(self) -> bool:
        """Curriculum flag: trials become harder as the best individuals pass them."""
        ...

    def levels(self, settings: Any) -> jax.Array | int:
        """Number [] of times that trials become harder."""
        ...

    def harder(self, trials: Starts, settings: Any, level: jax.Array) -> Starts:
        """Return the trials [R, ...] at this level [] of the curriculum."""
        ...

    def mastered(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """Return whether [] these terms, means over an individual's trials, allow harder trials."""
        ...

    def aim(self, trial: Starts) -> Any:
        """Data of the trial besides the start: a goal, a light; () if none."""
        ...

    def standards(self, settings: Any) -> Any:
        """Task parameters that an episode keeps, plain or traced."""
        ...

    def senses(self, aim: Any, sensed: Sensed) -> Mapping[str, jax.Array]:
        """Observations that the task adds, by name."""
        ...

    def onward(self, aim: Any, sensed: Sensed) -> Any:
        """Goal from the next step on."""
        ...

    def init(self) -> Any:
        """Return the empty episode statistics."""
        ...

    def ended(self, sensed: Sensed, aim: Any) -> jax.Array:
        """Reason [] to end the episode now; `FINISHED` continues it."""
        ...

    def update(
        self, tally: Any, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Any:
        """Return the statistics after one more step under this torque [J] in N·m."""
        ...

    def judge(self, tally: Any, settings: Any) -> Mapping[str, jax.Array]:
        """Fitness terms [] of an episode by name, each without unit and before its weight."""
        ...

    def outcome(self, tally: Any) -> Mapping[str, jax.Array]:
        """Metrics by name, in m, s or counts; never a score converted back."""
        ...

    def weights(self, settings: Any, generation: jax.Array) -> Mapping[str, jax.Array]:
        """Weight of each term [] at a generation; penalties are negative."""
        ...
