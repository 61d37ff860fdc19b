"""Hop task: reach a goal some way ahead, and stay there."""

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.config.rollout import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends
from mjxgait.creature.settings import Termination
from mjxgait.tasks.falls import touches
from mjxgait.tasks.hop.config import GOALS, NOMINAL_GOAL, HopConfig
from mjxgait.tasks.hop.fitness import fitness_terms, signed_weights, terms_under
from mjxgait.tasks.hop.stats import (
    Standards,
    Tally,
    away,
    empty,
    goal_distance,
    rested,
    updated,
    with_extras,
)
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.starts import Starts, draw_starts
from mjxgait.types import Sensed


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
        settings: Any = None,
    ) -> None:
        super().__init__(body, step, horizon, ends)
        self.settings = settings or self.Settings()

    @classmethod
    def told(
        cls, body: Body, step: float, horizon: int, ends: Termination | Ends, settings: Any
    ) -> "Hop":
        """Return the task with these settings, which decide the terms."""
        return cls(body, step, horizon, ends, settings)

    @property
    def terms(self) -> tuple[str, ...]:
        """See `Task`."""
        return terms_under(self.settings.weights)

    @property
    def sub_goals(self) -> tuple[float, ...]:
        """Points to pass, as shares of the way; none if they have no weight."""
        return self.settings.sub_goals if "sub_goals" in self.terms else ()

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`: the usual starts, each with a goal of its own; the first is nominal."""
        starts = draw_starts(key, creature, settings)
        low, high = self.goals
        # A separate key keeps the starts the same as those of every other task.
        drawn = jax.random.uniform(jax.random.fold_in(key, 4), (settings.starts,))
        goals = (low + (high - low) * drawn).at[0].set(self.nominal)
        return dataclasses.replace(starts, goal=goals)

    def aim(self, trial: Starts) -> jax.Array:
        """See `Task`: the goal [] in m ahead of the start."""
        return jnp.asarray(trial.goal)

    def standards(self, settings: Any) -> Any:
        """See `Task`."""
        return Standards(jnp.round(settings.rest / self.step))

    def senses(self, aim: jax.Array, sensed: Sensed) -> dict[str, jax.Array]:
        """See `Task`."""
        return {"goal_distance": goal_distance(self.creature, aim, sensed)}

    def init(self) -> Tally:
        """See `Task`."""
        energy = "energy" in self.terms
        return empty(self.creature, self.horizon, energy, len(self.sub_goals))

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: Any, aim: jax.Array
    ) -> Tally:
        """See `Task`."""
        after = updated(self.creature, self.step, tally, sensed, aim)
        after = with_extras(after, sensed, torque, self.step, self.sub_goals)
        return rested(after, self.horizon, standards.rest, touches(self.creature, sensed))

    def judge(self, tally: Tally, settings: HopConfig) -> dict[str, jax.Array]:
        """See `Task`."""
        return fitness_terms(self.creature, self.horizon, tally)

    def outcome(self, tally: Tally) -> dict[str, jax.Array]:
        """See `Task`: final distance in m and in goal distances; s to the arrival and the end."""
        left = away(tally)
        return {
            "left": left,
            "off": left / tally.goal,
            "arrival": tally.arrived * self.step,
            "seconds": tally.steps * self.step,
        }

    def weights(self, settings: HopConfig, generation: jax.Array) -> dict[str, jax.Array]:
        """See `Task`."""
        return signed_weights(settings, generation)
