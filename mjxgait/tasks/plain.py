"""Base class of plain tasks: stand at the start, do something, do not fall."""

import abc
import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.config.schema import RolloutConfig
from mjxgait.config.tables import NoSettings
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends
from mjxgait.creature.settings import Termination
from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.falls import why_fallen
from mjxgait.tasks.starts import Starts, draw_starts
from mjxgait.types import Sensed


class PlainTask(abc.ABC):
    """Base class for user-defined tasks (docs/guide/your-own-task.md).

    A subclass needs `counts`, the weight of each fitness term by name, and `evaluate`. Its own
    statistics of an episode go into a `EpisodeStats` of its own. `Settings` is a frozen dataclass
    of numbers that become keys of `[fitness]`. step: s. horizon: T, steps of a full episode. ends:
    definition of a fall.
    """

    Settings: ClassVar[type] = NoSettings
    counts: ClassVar[Mapping[str, float]] = {}
    outcomes: ClassVar[tuple[str, ...]] = ("seconds",)
    adds: ClassVar[tuple[str, ...]] = ()

    def __init__(self, creature: Body, step: float, horizon: int, ends: Termination | Ends) -> None:
        self.creature, self.step, self.horizon, self.ends = creature, step, horizon, ends

    @property
    def terms(self) -> tuple[str, ...]:
        """See `Task`."""
        return tuple(self.counts)

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """The first start is nominal, the others are perturbed and pushed."""
        return draw_starts(key, creature, settings)

    @property
    def has_curriculum(self) -> bool:
        """See `Task`."""
        return False

    def levels(self, settings: Any) -> jax.Array | int:
        """See `Task`."""
        return 0

    def at_level(self, trials: Starts, settings: Any, level: jax.Array) -> Starts:
        """Return the trials unchanged."""
        return trials

    def level_passed(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """See `Task`."""
        return jnp.zeros((), bool)

    def goal(self, trial: Starts) -> object:
        """See `Task`."""
        return ()

    def params(self, settings: Any) -> Any:
        """See `Task`."""
        return settings

    def observations(self, goal: Any, sensed: Sensed) -> Mapping[str, jax.Array]:
        """See `Task`."""
        return {}

    def next_goal(self, goal: Any, sensed: Sensed) -> Any:
        """Keep the goal."""
        return goal

    def init(self) -> EpisodeStats:
        """See `Task`."""
        none = jnp.zeros((), jnp.int32)
        return EpisodeStats(steps=none, reason=none, overlap=jnp.zeros(()))

    def ended(self, sensed: Sensed, goal: Any) -> jax.Array:
        """A fall ends the episode."""
        return why_fallen(self.creature, self.ends, sensed)

    def update(self, stats: Any, sensed: Sensed, torque: jax.Array, params: Any, goal: Any) -> Any:
        """Count one more step."""
        return dataclasses.replace(stats, steps=stats.steps + 1)

    @abc.abstractmethod
    def evaluate(self, stats: Any, settings: Any) -> Mapping[str, jax.Array]:
        """See `Task`."""

    @classmethod
    def criteria(cls, window: Any) -> tuple[Any, ...]:
        """Acceptance criteria besides staying up, as `certification.criteria.Criterion`.

        Numbered from 10, from a `reference.measure.Recording` after its warm-up.
        """
        return ()

    def outcome(self, stats: Any) -> Mapping[str, jax.Array]:
        """Time in s until the end."""
        return {"seconds": stats.steps * self.step}

    def weights(self, settings: Any, generation: jax.Array) -> Mapping[str, jax.Array]:
        """See `Task`."""
        return {name: jnp.float32(weight) for name, weight in self.counts.items()}
