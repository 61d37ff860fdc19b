"""What rollout and evolution ask of a task: the one contract that walking, hopping and swimming share."""

from collections.abc import Mapping
from typing import Any, Protocol

import jax

from mjxgait.config.rollout import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed, pytree

FINISHED, NONFINITE = 0, -1
"""Why an episode ended: it was over, or its numbers were no longer finite. Tasks add their own."""


@pytree
class Tally:
    """What every task keeps of an episode; a task's own tally adds fields to it.

    steps: [] that the creature lived. reason: [] why the episode ended.
    overlap: [] m, the deepest that parts were in each other of the times they were looked at.
    """

    steps: jax.Array
    reason: jax.Array
    overlap: jax.Array


class Task(Protocol):
    """What one creature is to do.

    Every method but `trials` is for one episode, and is mapped over lanes and episodes.
    """

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the fitness terms, in the order in which they are stored."""
        ...

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of what a person would measure, in the order in which they are stored."""
        ...

    @property
    def adds(self) -> tuple[str, ...]:
        """Names of the senses that the task adds."""
        ...

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """The R trials [R, ...] that everybody is judged on; drawn once, by the host."""
        ...

    @property
    def climbs(self) -> bool:
        """Whether trials become harder as the best master them."""
        ...

    def levels(self, settings: Any) -> jax.Array | int:
        """How many times [] they become harder."""
        ...

    def harder(self, trials: Starts, settings: Any, level: jax.Array) -> Starts:
        """The trials [R, ...] after they have become harder so many times []."""
        ...

    def mastered(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """Whether [] one of these terms, means over its trials, is ready for harder ones."""
        ...

    def aim(self, trial: Starts) -> Any:
        """What an episode keeps of its trial besides the start: a goal, a light; () if nothing."""
        ...

    def standards(self, settings: Any) -> Any:
        """What an episode keeps of the task's settings, plain or traced."""
        ...

    def senses(self, aim: Any, sensed: Sensed) -> Mapping[str, jax.Array]:
        """The senses that the task adds, by name."""
        ...

    def onward(self, aim: Any, sensed: Sensed) -> Any:
        """What it aims at from the next step on."""
        ...

    def init(self) -> Any:
        """The empty tally."""
        ...

    def ended(self, sensed: Sensed, aim: Any) -> jax.Array:
        """The reason [] to end the episode at this moment; `FINISHED` while all is well."""
        ...

    def update(
        self, tally: Any, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Any:
        """The tally after one more step under this torque [J] in N·m."""
        ...

    def judge(self, tally: Any, settings: Any) -> Mapping[str, jax.Array]:
        """The fitness terms [] of an episode by name, each without unit and before its weight."""
        ...

    def outcome(self, tally: Any) -> Mapping[str, jax.Array]:
        """What a person would measure, by name: m, s, how often; never a score turned back."""
        ...

    def weights(self, settings: Any, generation: jax.Array) -> Mapping[str, jax.Array]:
        """What each term [] counts at a generation; a penalty counts negatively."""
        ...
