"""Walking as a task: forward, upright, in the manner that the settings ask for."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.creature import Creature
from mjxgait.creature.settings import Termination
from mjxgait.settings.config import FitnessConfig, RolloutConfig
from mjxgait.tasks.trials import Starts, draw_starts
from mjxgait.tasks.walk.fitness import TERMS, fitness_terms, signed_weights
from mjxgait.tasks.walk.tally import Judge, Tally
from mjxgait.types import Sensed


@dataclasses.dataclass(frozen=True, eq=False)
class Walk:
    """One creature's walk. step: s. horizon: T, steps of a full episode. ends: what ends one early."""

    creature: Creature
    step: float
    horizon: int
    ends: Termination
    terms = TERMS
    outcomes = ("forward", "aside", "seconds")
    adds = ()

    @property
    def _keeper(self) -> Judge:
        return Judge(self.creature, self.step, self.horizon // 2, self.ends)

    def trials(self, key: jax.Array, settings: RolloutConfig) -> Starts:
        """See `Task`: the first start is nominal, the others are perturbed and pushed."""
        return draw_starts(key, self.creature, settings)

    def aim(self, trial: Starts) -> tuple[()]:
        """See `Task`: a walk has none but forward."""
        return ()

    def standards(self, settings: FitnessConfig) -> jax.Array:
        """See `Task`: the clearance [] in m that is wanted of each swing."""
        return jnp.asarray(settings.clearance * self.creature.hip_height, jnp.float32)

    def senses(self, aim: Any, sensed: Sensed) -> Mapping[str, jax.Array]:
        """See `Task`."""
        return {}

    def init(self) -> Tally:
        """See `Task`."""
        return self._keeper.init()

    def ended(self, sensed: Sensed, aim: Any) -> jax.Array:
        """See `Task`."""
        return self._keeper.examine(sensed)

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: jax.Array, aim: Any
    ) -> Tally:
        """See `Task`."""
        return self._keeper.update(tally, sensed, torque, standards)

    def judge(self, tally: Tally, settings: FitnessConfig) -> dict[str, jax.Array]:
        """See `Task`."""
        return fitness_terms(self.creature, settings, self.step, self.horizon, tally)

    def outcome(self, tally: Tally) -> dict[str, jax.Array]:
        """See `Task`: m forward and to the left until the end, and s until then."""
        return {
            "forward": tally.forward,
            "aside": tally.left,
            "seconds": tally.steps * self.step,
        }

    def weights(self, settings: FitnessConfig, generation: jax.Array) -> dict[str, jax.Array]:
        """See `Task`."""
        return signed_weights(settings, generation)
