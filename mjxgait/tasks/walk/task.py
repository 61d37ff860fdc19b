"""Walk task: forward, upright, in the manner given by the settings."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.config.schema import RolloutConfig
from mjxgait.controllers.observations import sense
from mjxgait.creature import Creature
from mjxgait.creature.body import Body, Ends
from mjxgait.creature.settings import Termination
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.starts import Starts, draw_starts, milder
from mjxgait.tasks.terms import hardness
from mjxgait.tasks.walk.config import TargetConfig, WalkConfig
from mjxgait.tasks.walk.fitness import (
    fitness_terms,
    signed_weights,
    target_terms,
    target_weights,
    terms_under,
)
from mjxgait.tasks.walk.stats import StatsRecorder, WalkStats
from mjxgait.tasks.walk.target_stats import (
    TargetStats,
    along,
    target_stats,
    target_updated,
    wrapped,
)
from mjxgait.types import Sensed

Heading = tuple[()] | tuple[jax.Array, jax.Array]
"""Commanded heading [] in rad and its change per step; empty without a command."""
FALLEN = 0.2
"""Largest share of falls at which an individual is ready for harder trials."""


class Walk(PlainTask):
    """Walk of one creature; see `PlainTask`."""

    Settings = WalkConfig
    outcomes = ("forward", "aside", "seconds")

    def __init__(
        self,
        body: Body,
        step: float,
        horizon: int,
        ends: Termination | Ends,
        settings: WalkConfig | None = None,
    ) -> None:
        super().__init__(body, step, horizon, ends)
        self.settings = settings or WalkConfig()

    @property
    @override
    def terms(self) -> tuple[str, ...]:
        return terms_under(self.settings.weights)

    @classmethod
    def with_settings(
        cls, body: Body, step: float, horizon: int, ends: Termination | Ends, settings: WalkConfig
    ) -> "Walk":
        """Return the task with these settings; targets need additional statistics."""
        if settings.wish.requested and cls is Walk:
            return TargetedWalk(body, step, horizon, ends, settings)
        return cls(body, step, horizon, ends, settings)

    @property
    @override
    def has_curriculum(self) -> bool:
        return self.settings.hardening > 0

    @override
    def levels(self, settings: WalkConfig) -> int:
        return settings.hardening

    def at_level(self, trials: Starts, settings: WalkConfig, level: jax.Array) -> Starts:
        """Disturbances grow, so that individuals learn to withstand them bit by bit."""
        return milder(trials, hardness(settings.hardening, level))

    def level_passed(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """Hardly any falls."""
        return terms["fall"] <= FALLEN

    @property
    def _recorder(self) -> StatsRecorder:
        return StatsRecorder(self.creature, self.step, self.horizon // 2, self.settings.contact)

    def params(self, settings: WalkConfig) -> jax.Array:
        """The wanted clearance [] of each swing in m."""
        return jnp.asarray(settings.clearance * self.creature.frame.hip_height, jnp.float32)

    @override
    def init(self) -> WalkStats:
        return self._recorder.init()

    @override
    def update(
        self, stats: Any, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Any
    ) -> WalkStats:
        return self._recorder.update(stats, sensed, torque, params)

    @override
    def evaluate(self, stats: Any, settings: WalkConfig) -> dict[str, jax.Array]:
        return fitness_terms(self.creature, settings, self.step, self.horizon, stats)

    def outcome(self, stats: WalkStats) -> dict[str, jax.Array]:
        """Distance in m forward and to the left, and s until the end."""
        return {
            "forward": stats.forward,
            "aside": stats.left,
            "seconds": stats.steps * self.step,
        }

    @override
    def weights(self, settings: WalkConfig, generation: jax.Array) -> dict[str, jax.Array]:
        return signed_weights(settings, generation)


class TargetedWalk(Walk):
    """Walk with targets; see `TargetConfig`.

    A turn is commanded as a heading that turns. Distances are measured along it: forward and to the
    left of the heading commanded at each moment.
    """

    @property
    def wish(self) -> TargetConfig:
        """Targets of the walk."""
        return self.settings.wish

    @property
    @override
    def terms(self) -> tuple[str, ...]:
        return (*super().terms, *target_weights(self.wish))

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """The usual initial conditions, and the rate [R] of the commanded turn in rad/s.

        With `turn`, all have the target rate. With `steer`, the first goes straight; the others
        turn left and right alternately, at half the target rate at least.
        """
        starts, count = draw_starts(key, creature, settings), settings.starts
        if self.wish.turn is not None:
            rate = jnp.full(count, self.wish.turn)
        elif self.wish.steer is not None:
            drawn = jax.random.uniform(jax.random.fold_in(key, 5), (count,), minval=0.5)
            side = jnp.where(jnp.arange(count) % 2 == 1, 1.0, -1.0).at[0].set(0.0)
            rate = self.wish.steer * side * drawn
        else:
            return starts
        return dataclasses.replace(starts, goal=jnp.radians(rate))

    def goal(self, trial: Starts) -> Heading:
        """The commanded heading [] in rad, and its change per step."""
        if trial.goal is None:
            return ()
        return jnp.zeros(()), trial.goal * self.step

    @override
    def next_goal(self, goal: Heading, sensed: Sensed) -> Heading:
        return (goal[0] + goal[1], goal[1]) if goal else goal

    def observations(self, goal: Heading, sensed: Sensed) -> dict[str, jax.Array]:
        """With a commanded heading there is no line to return to."""
        if not goal:
            return {}
        heading = sense(self.creature, sensed, jnp.zeros(()), ["heading"])["heading"]
        return {"heading": wrapped(heading - goal[0]), "aside": jnp.zeros(())}

    @override
    def init(self) -> TargetStats:
        return target_stats(super().init(), len(self.creature.feet.names))

    @override
    def update(
        self,
        stats: TargetStats,
        sensed: Sensed,
        torque: jax.Array,
        params: jax.Array,
        goal: Heading,
    ) -> TargetStats:
        plain = self._recorder.update(stats, sensed, torque, params)
        after = target_updated(self.creature, stats, plain, sensed)
        return along(stats, after, goal[0], self.horizon // 2) if goal else after

    @override
    def evaluate(self, stats: TargetStats, settings: WalkConfig) -> dict[str, jax.Array]:
        return target_terms(self.creature, settings, self.step, self.horizon, stats)

    @override
    def weights(self, settings: WalkConfig, generation: jax.Array) -> dict[str, jax.Array]:
        weights = target_weights(settings.wish)
        return super().weights(settings, generation) | {
            n: -jnp.float32(w) for n, w in weights.items()
        }
