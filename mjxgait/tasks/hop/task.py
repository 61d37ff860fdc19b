"""Hop task: reach a goal some way ahead, and stay there."""

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends
from mjxgait.creature.settings import Termination
from mjxgait.tasks.falls import touches
from mjxgait.tasks.hop.config import GOALS, NEAR, NOMINAL_GOAL, GoalConfig, HopConfig, TravelConfig
from mjxgait.tasks.hop.fitness import (
    GOAL,
    fitness_terms,
    signed_weights,
    style_terms,
    terms_under,
)
from mjxgait.tasks.hop.stats import (
    HopParams,
    HopStats,
    away,
    empty,
    goal_distance,
    rested,
    updated,
    with_extras,
)
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.starts import Starts, draw_starts
from mjxgait.types import Sensed, pytree


class Hop(PlainTask):
    """Path of one creature to a goal; see `PlainTask`. Any creature with a trunk can do it."""

    Settings: ClassVar[type] = HopConfig
    outcomes: ClassVar[tuple[str, ...]] = ("left", "off", "arrival", "seconds")
    adds: ClassVar[tuple[str, ...]] = ("goal_distance",)
    goals: ClassVar[tuple[float, float]] = GOALS
    nominal: ClassVar[float] = NOMINAL_GOAL

    def __init__(
        self,
        body: Body,
        step: float,
        horizon: int,
        ends: Termination | Ends,
        settings: GoalConfig | None = None,
    ) -> None:
        super().__init__(body, step, horizon, ends)
        self.settings: Any = settings or self.Settings()

    @classmethod
    def with_settings(
        cls, body: Body, step: float, horizon: int, ends: Termination | Ends, settings: GoalConfig
    ) -> "Hop":
        """Return the task with these settings, which decide the terms."""
        return cls(body, step, horizon, ends, settings)

    @property
    @override
    def terms(self) -> tuple[str, ...]:
        return terms_under(self.settings.weights)

    @property
    def sub_goals(self) -> tuple[float, ...]:
        """Points to pass, as shares of the way; none if they have no weight."""
        return self.settings.sub_goals if "sub_goals" in self.terms else ()

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """The usual starts, each with its goal [] in m ahead; the first is nominal."""
        starts = draw_starts(key, creature, settings)
        low, high = self.goals
        # A separate key keeps the starts the same as those of every other task.
        drawn = jax.random.uniform(jax.random.fold_in(key, 4), (settings.starts,))
        goals = (low + (high - low) * drawn).at[0].set(self.nominal)
        return dataclasses.replace(starts, goal=goals)

    def goal(self, trial: Starts) -> jax.Array:
        """The goal [] in m ahead of the start."""
        return jnp.asarray(trial.goal)

    @override
    def params(self, settings: GoalConfig) -> HopParams:
        return HopParams(jnp.round(settings.rest / self.step))

    @override
    def observations(self, goal: jax.Array, sensed: Sensed) -> dict[str, jax.Array]:
        return {"goal_distance": goal_distance(self.creature, goal, sensed)}

    @override
    def init(self) -> HopStats:
        energy = "energy" in self.terms
        return empty(self.creature, self.horizon, energy, len(self.sub_goals))

    @override
    def update(
        self,
        stats: HopStats,
        sensed: Sensed,
        torque: jax.Array,
        params: HopParams,
        goal: jax.Array,
    ) -> HopStats:
        after = updated(self.creature, self.step, stats, sensed, goal)
        after = with_extras(after, sensed, torque, self.step, self.sub_goals)
        return rested(after, self.horizon, params.rest, touches(self.creature, sensed))

    @override
    def evaluate(self, stats: HopStats, settings: HopConfig) -> dict[str, jax.Array]:
        return fitness_terms(self.creature, self.horizon, stats)

    def outcome(self, stats: HopStats) -> dict[str, jax.Array]:
        """Final distance in m and in goal distances; s to the arrival and the end."""
        left = away(stats)
        return {
            "left": left,
            "off": left / stats.goal,
            "arrival": stats.arrived * self.step,
            "seconds": stats.steps * self.step,
        }

    @override
    def weights(
        self, settings: HopConfig | TravelConfig, generation: jax.Array
    ) -> dict[str, jax.Array]:
        return signed_weights(settings, generation)


@pytree
class TravelStats(HopStats):
    """Extension of `HopStats`; goal is the latest. reached: [] goals."""

    reached: jax.Array


@pytree
class TravelGoal:
    """Goal of the moment.

    ahead: [] m from the start to the goal. spacing: [] m from one goal to the next.
    """

    ahead: jax.Array
    spacing: jax.Array


class Travel(Hop):
    """Path of one creature from goal to goal; see `Hop`."""

    Settings: ClassVar[type] = TravelConfig
    outcomes = ("goals", "way", "seconds")

    def goal(self, trial: Starts) -> Any:
        """The distance to the first goal is also the spacing of all others."""
        goal = jnp.asarray(trial.goal)
        return TravelGoal(goal, goal)

    def next_goal(self, goal: TravelGoal, sensed: Sensed) -> TravelGoal:
        """A goal that is near, or passed, moves on."""
        left = goal_distance(self.creature, goal.ahead, sensed)
        reached = left <= NEAR * goal.spacing
        return dataclasses.replace(goal, ahead=goal.ahead + jnp.where(reached, goal.spacing, 0.0))

    @override
    def observations(self, goal: Any, sensed: Sensed) -> dict[str, jax.Array]:
        return super().observations(goal.ahead, sensed)

    @override
    def init(self) -> TravelStats:
        return TravelStats(**vars(super().init()), reached=jnp.zeros((), jnp.int32))

    @override
    def update(
        self, stats: HopStats, sensed: Sensed, torque: jax.Array, params: HopParams, goal: Any
    ) -> Any:
        after: Any = super().update(stats, sensed, torque, params, goal.ahead)
        reached = jnp.round(goal.ahead / goal.spacing).astype(jnp.int32) - 1
        return dataclasses.replace(after, reached=reached)

    def evaluate(self, stats: HopStats, settings: object) -> dict[str, jax.Array]:
        """Style counts in proportion to the share of the way to the nominal goal."""
        way = self._way(stats) / NOMINAL_GOAL
        style = style_terms(self.creature, self.horizon, stats)
        near = jnp.clip(way, 0.0, 1.0)
        return {GOAL: 1.0 - way} | {n: near * style[n] for n in self.terms if n != GOAL}

    def outcome(self, stats: Any) -> dict[str, jax.Array]:
        """Goals reached, m ahead of the start, s until the end."""
        return {
            "goals": stats.reached.astype(jnp.float32),
            "way": self._way(stats),
            "seconds": stats.steps * self.step,
        }

    def _way(self, stats: HopStats) -> jax.Array:
        return jnp.where(stats.steps > 0, stats.goal - stats.left, 0.0)
