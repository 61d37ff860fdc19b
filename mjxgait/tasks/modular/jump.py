"""Jump task for modular bodies: leave the ground, again and again."""

import dataclasses
from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.modular.base import (
    SHARPNESS,
    ModularTask,
    modular_sensed,
    share_lost,
)
from mjxgait.tasks.modular.config import JumpConfig, JumpWeights
from mjxgait.types import Sensed, pytree

SPAN = 2.0
"""Length in s of the spans of the time that counts; the body must jump in each.

Once in eight seconds some individual leaves the ground by chance, as high as real jumpers, and only
in the trial that it was selected by.
"""
LEAST = 0.01
"""m, height of a leap; without one in a span the episode ends: bodies that lie still stay so."""
LYING = 2
"""Reason for that end."""


@pytree
class JumpStats(EpisodeStats):
    """Extension of `EpisodeStats`.

    heights: [P] m, greatest height of the lowest part in each of P spans.
    """

    heights: jax.Array


class Jump(ModularTask):
    """Implementation of `Task`: on land."""

    Settings: ClassVar[type] = JumpConfig
    terms = tuple(field.name for field in dataclasses.fields(JumpWeights))
    outcomes = ("height", "seconds")

    @property
    def spans(self) -> int:
        """Number of spans, P, without about one for settling."""
        return max(round(self.horizon * self.step / SPAN) - 1, 2)

    @override
    def init(self) -> JumpStats:
        none = jnp.zeros((), jnp.int32)
        return JumpStats(none, none, jnp.zeros(()), jnp.zeros(self.spans))

    @override
    def update(
        self, stats: JumpStats, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: object
    ) -> JumpStats:
        begins, low = stats.steps <= params, jnp.min(sensed.geom_low)
        span = self.spans * (stats.steps - params) // jnp.maximum(self.horizon - params, 1)
        number = jnp.arange(self.spans)
        now = (number == span) & ~begins
        lies = jnp.any((number < span) & (stats.heights < LEAST)) & ~begins
        return dataclasses.replace(
            stats,
            steps=stats.steps + 1,
            reason=jnp.where(lies, LYING, stats.reason),
            overlap=jnp.where(
                begins, stats.overlap, jnp.maximum(stats.overlap, modular_sensed(sensed).depth)
            ),
            heights=jnp.where(now, jnp.maximum(stats.heights, low), stats.heights),
        )

    def evaluate(self, stats: JumpStats, settings: JumpConfig) -> Mapping[str, jax.Array]:
        """Height in m; its loss by overlap; the loss of the rest by an early end.

        Blocks overlap each other or the ground. An early end costs: the wildest leap is the last,
        and a body that lies still does not jump again.
        """
        height = jnp.mean(stats.heights)
        inside = share_lost((stats.overlap / settings.overlap) ** SHARPNESS)
        lived = (1 - inside) * stats.steps / self.horizon
        return {
            "height": height,
            "overlap": height * inside,
            "wild": height * (1 - inside - lived),
        }

    def outcome(self, stats: JumpStats) -> Mapping[str, jax.Array]:
        """Height in m, and s until the end."""
        return {"height": jnp.mean(stats.heights), "seconds": stats.steps * self.step}
