"""The task `turn`: what an episode counts, and its fitness terms, in JAX."""

import dataclasses
from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.config.tables import STRICT, Positive
from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.terms import overlap_cost, positive_work
from mjxgait.types import Sensed, pytree


@dataclasses.dataclass(frozen=True)
class TurnSettings:
    """Keys of `[fitness]`.

    Attributes:
      rate: Turn to the left in deg/s that earns the whole term `turned`.
    """

    __pydantic_config__ = STRICT
    rate: Positive = 60.0


@pytree
class TurnStats(EpisodeStats):
    """Statistics of an episode.

    turned: [] rad to the left. work: [] J of the joints. away: [] m s, the distance from the start
    summed over time. start: [2] m, place of the trunk at the first step.
    """

    turned: jax.Array
    work: jax.Array
    away: jax.Array
    start: jax.Array


class Turn(PlainTask):
    """Turn to the left as fast as wanted, near the start, and stay up."""

    Settings = TurnSettings
    counts: ClassVar[Mapping[str, float]] = {
        "alive": 1.0,
        "turned": 3.0,
        "away": -1.0,
        "work": -0.05,
        "overlap": -4.0,
    }
    outcomes = ("seconds", "turned", "away")

    @override
    def init(self) -> TurnStats:
        none, zero = jnp.zeros((), jnp.int32), jnp.zeros(())
        return TurnStats(
            steps=none,
            reason=none,
            overlap=zero,
            turned=zero,
            work=zero,
            away=zero,
            start=jnp.zeros(2),
        )

    @override
    def update(
        self, stats: TurnStats, sensed: Sensed, torque: jax.Array, params: object, goal: object
    ) -> TurnStats:
        place = sensed.trunk_pos[:2]
        start = jnp.where(stats.steps == 0, place, stats.start)
        return dataclasses.replace(
            stats,
            steps=stats.steps + 1,
            turned=stats.turned + sensed.trunk_angvel[2] * self.step,
            work=stats.work + positive_work(torque, sensed, self.step),
            away=stats.away + jnp.linalg.norm(place - start) * self.step,
            start=start,
        )

    @override
    def evaluate(self, stats: TurnStats, settings: TurnSettings) -> Mapping[str, jax.Array]:
        seconds, frame = self.horizon * self.step, self.creature.frame
        rate = jnp.degrees(stats.turned) / seconds
        weight_lifted = frame.mass * 9.81 * frame.hip_height * seconds
        return {
            "alive": stats.steps / self.horizon,
            "turned": jnp.clip(rate / settings.rate, -1.0, 1.0),
            "away": stats.away / (frame.hip_height * seconds),
            "work": stats.work / weight_lifted,
            "overlap": overlap_cost(self.creature, stats.overlap),
        }

    @override
    def outcome(self, stats: TurnStats) -> Mapping[str, jax.Array]:
        seconds = stats.steps * self.step
        return {
            "seconds": seconds,
            "turned": stats.turned,
            "away": stats.away / jnp.maximum(seconds, self.step),
        }
