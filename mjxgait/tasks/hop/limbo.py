"""Limbo task: reach a goal beneath a bar, with every part clear of the bar."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.config.rollout import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.creature.ground.spec import parse_ground
from mjxgait.errors import UserError
from mjxgait.tasks.hop import stats as hop
from mjxgait.tasks.hop.bar import bar_distance, intrusion
from mjxgait.tasks.hop.fitness import MISSED, fitness_terms
from mjxgait.tasks.hop.limbo_config import GOALS, NOMINAL_GOAL, LimboConfig
from mjxgait.tasks.hop.task import Hop
from mjxgait.tasks.score import ramped
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed, pytree

DEEP = 0.3
"""Depth in the bar, in hip heights, at which the penalty is full."""
THERE, BENEATH = 0.6, 0.05
"""Largest means over the trials of the terms `missed` and `bar` at which the bar is lowered."""


@pytree
class Aim:
    """Goal and bar of one trial.

    goal: [] m ahead of the start. raised: [] m by which the bar is above its final height.
    """

    goal: jax.Array
    raised: jax.Array


@pytree
class Tally(hop.Tally):
    """See `hop.Tally`.

    bar: [] m, greatest depth in the bar at its final height.
    raised: [] m of it that cost nothing yet.
    height: [] m, of the bar in the end.
    """

    bar: jax.Array
    raised: jax.Array
    height: jax.Array


@pytree
class Standards(hop.Standards):
    """See `hop.Standards`. height: [] m, of the bar."""

    height: jax.Array


class Limbo(Hop):
    """Path of one creature to a goal beneath a bar; see `Hop`."""

    Settings = LimboConfig
    outcomes = (*Hop.outcomes, "bar")
    adds = (*Hop.adds, "bar_distance")
    climbs = True
    goals, nominal = GOALS, NOMINAL_GOAL

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`.

        Raises:
          UserError: the ground is not flat, so a bar has no single height.
        """
        if not parse_ground(settings.ground).flat:
            raise UserError(f"rollout.ground = {settings.ground}: task limbo needs flat ground")
        starts = super().trials(key, creature, settings)
        return dataclasses.replace(starts, raised=jnp.zeros(settings.starts))

    def levels(self, settings: Any) -> jax.Array | int:
        """See `Task`."""
        steps: jax.Array | int = settings.lowering
        return steps

    def harder(self, trials: Starts, settings: Any, level: jax.Array) -> Starts:
        """See `Task`: the bar comes down, so that hoppers learn to duck little by little."""
        left = 1.0 - ramped(settings.lowering, level)
        raised = jnp.full(trials.friction.shape, settings.higher * left)
        return dataclasses.replace(trials, raised=raised)

    def mastered(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """See `Task`: at the goal in the end, and hardly in the bar."""
        return (terms[MISSED] <= THERE) & (terms["bar"] <= BENEATH)

    def aim(self, trial: Starts) -> Any:
        """See `Task`."""
        return Aim(super().aim(trial), jnp.asarray(trial.raised))

    def standards(self, settings: Any) -> Any:
        """See `Task`."""
        height = jnp.asarray(settings.height, jnp.float32)
        return Standards(**vars(super().standards(settings)), height=height)

    def senses(self, aim: Any, sensed: Sensed) -> dict[str, jax.Array]:
        """See `Task`."""
        return super().senses(aim.goal, sensed) | {
            "bar_distance": bar_distance(self.creature, sensed)
        }

    def init(self) -> Tally:
        """See `Task`."""
        none = jnp.zeros(())
        return Tally(**vars(super().init()), bar=none, raised=none, height=none)

    def update(
        self, tally: Any, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Any:
        """See `Task`."""
        after: Any = super().update(tally, sensed, torque, standards, aim.goal)
        deepest = jnp.maximum(tally.bar, intrusion(self.creature, sensed, standards.height))
        return dataclasses.replace(after, bar=deepest, raised=aim.raised, height=standards.height)

    def judge(self, tally: Any, settings: Any) -> dict[str, jax.Array]:
        """See `Task`."""
        deep = jnp.maximum(tally.bar - tally.raised, 0.0)
        bar = jnp.minimum(deep / (DEEP * self.creature.frame.hip_height), 1.0)
        return fitness_terms(self.creature, self.horizon, tally, {"bar": bar})

    def outcome(self, tally: Any) -> dict[str, jax.Array]:
        """See `Task`: as for hopping, and the height in m of a bar that would just be cleared.

        It is at least the height of the bar itself.
        """
        return super().outcome(tally) | {"bar": tally.height + tally.bar}
