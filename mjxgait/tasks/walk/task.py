"""Walking as a task: forward, upright, in the manner that the settings ask for."""

from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.settings.walk import WalkConfig
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.walk.fitness import TERMS, fitness_terms, signed_weights
from mjxgait.tasks.walk.tally import Judge, Tally
from mjxgait.types import Sensed


class Walk(PlainTask):
    """One creature's walk; see `PlainTask`."""

    Settings = WalkConfig
    terms = TERMS
    outcomes = ("forward", "aside", "seconds")

    @property
    def _keeper(self) -> Judge:
        return Judge(self.creature, self.step, self.horizon // 2)

    def standards(self, settings: WalkConfig) -> jax.Array:
        """See `Task`: the clearance [] in m that is wanted of each swing."""
        return jnp.asarray(settings.clearance * self.creature.frame.hip_height, jnp.float32)

    def init(self) -> Tally:
        """See `Task`."""
        return self._keeper.init()

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: jax.Array, aim: Any
    ) -> Tally:
        """See `Task`."""
        return self._keeper.update(tally, sensed, torque, standards)

    def judge(self, tally: Tally, settings: WalkConfig) -> dict[str, jax.Array]:
        """See `Task`."""
        return fitness_terms(self.creature, settings, self.step, self.horizon, tally)

    def outcome(self, tally: Tally) -> dict[str, jax.Array]:
        """See `Task`: m forward and to the left until the end, and s until then."""
        return {
            "forward": tally.forward,
            "aside": tally.left,
            "seconds": tally.steps * self.step,
        }

    def weights(self, settings: WalkConfig, generation: jax.Array) -> dict[str, jax.Array]:
        """See `Task`."""
        return signed_weights(settings, generation)
