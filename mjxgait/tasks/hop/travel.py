"""Travel task: reach a goal that moves on as soon as it is reached."""

import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.tasks.hop import stats as hop
from mjxgait.tasks.hop.config import NEAR, NOMINAL_GOAL, TravelConfig
from mjxgait.tasks.hop.fitness import GOAL, signed_weights, style_terms
from mjxgait.tasks.hop.task import Hop
from mjxgait.tasks.starts import Starts
from mjxgait.types import Sensed, pytree


@pytree
class Tally(hop.Tally):
    """See `hop.Tally`; goal is the latest. reached: [] goals."""

    reached: jax.Array


@pytree
class Aim:
    """Goal of the moment.

    goal: [] m ahead of the start. spacing: [] m from one goal to the next.
    """

    goal: jax.Array
    spacing: jax.Array


class Travel(Hop):
    """Path of one creature from goal to goal; see `Hop`."""

    Settings: ClassVar[type] = TravelConfig
    outcomes = ("goals", "way", "seconds")

    def aim(self, trial: Starts) -> Any:
        """See `Task`: the distance to the first goal is also the spacing of all others."""
        goal = jnp.asarray(trial.goal)
        return Aim(goal, goal)

    def onward(self, aim: Any, sensed: Sensed) -> Any:
        """See `Task`: a goal that is near, or passed, moves on."""
        left = hop.goal_distance(self.creature, aim.goal, sensed)
        reached = left <= NEAR * aim.spacing
        return dataclasses.replace(aim, goal=aim.goal + jnp.where(reached, aim.spacing, 0.0))

    def senses(self, aim: Any, sensed: Sensed) -> dict[str, jax.Array]:
        """See `Task`."""
        return super().senses(aim.goal, sensed)

    def init(self) -> Tally:
        """See `Task`."""
        return Tally(**vars(super().init()), reached=jnp.zeros((), jnp.int32))

    def update(
        self, tally: Any, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Any:
        """See `Task`."""
        after: Any = super().update(tally, sensed, torque, standards, aim.goal)
        reached = jnp.round(aim.goal / aim.spacing).astype(jnp.int32) - 1
        return dataclasses.replace(after, reached=reached)

    def judge(self, tally: Any, settings: Any) -> dict[str, jax.Array]:
        """See `Task`: style counts in proportion to the share of the way to the nominal goal."""
        way = self._way(tally) / NOMINAL_GOAL
        style = style_terms(self.creature, self.horizon, tally)
        near = jnp.clip(way, 0.0, 1.0)
        return {GOAL: 1.0 - way} | {n: near * style[n] for n in self.terms if n != GOAL}

    def outcome(self, tally: Any) -> dict[str, jax.Array]:
        """See `Task`: goals reached, m ahead of the start, s until the end."""
        return {
            "goals": tally.reached.astype(jnp.float32),
            "way": self._way(tally),
            "seconds": tally.steps * self.step,
        }

    def weights(self, settings: Any, generation: jax.Array) -> dict[str, jax.Array]:
        """See `Task`."""
        return signed_weights(settings, generation)

    def _way(self, tally: Any) -> jax.Array:
        return jnp.where(tally.steps > 0, tally.goal - tally.left, 0.0)
