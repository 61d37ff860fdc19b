"""Swim task for modular bodies: get as far as possible in water, without a floor."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.tasks.modular.base import (
    LITTLE,
    LocomotionStats,
    LocomotionTask,
    length,
    modular_sensed,
    share_lost,
)
from mjxgait.tasks.modular.config import SwimConfig, SwimWeights
from mjxgait.types import Sensed, pytree


@pytree
class SwimStats(LocomotionStats):
    """Extension of `LocomotionStats`.

    began: [3] kg·m/s, momentum of the body when counting began.
    given: [3] kg·m/s, from the water since then. exchanged: [] the same without directions.
    lacking: [] kg·m/s, the most that the water did not give.
    """

    began: jax.Array
    given: jax.Array
    exchanged: jax.Array
    lacking: jax.Array


class Swim(LocomotionTask):
    """Implementation of `Task`: in water, without a floor. The way is a straight line."""

    Settings: ClassVar[type] = SwimConfig
    terms = tuple(field.name for field in dataclasses.fields(SwimWeights))

    @override
    def init(self) -> SwimStats:
        nothing, nowhere = jnp.zeros(()), jnp.zeros(3)
        return SwimStats(
            **self.begun(), began=nowhere, given=nowhere, exchanged=nothing, lacking=nothing
        )

    @override
    def update(
        self, stats: SwimStats, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Any
    ) -> SwimStats:
        begins, momentum, push = (
            stats.steps <= params,
            modular_sensed(sensed).momentum,
            modular_sensed(sensed).water_force * self.step,
        )
        began = jnp.where(begins, momentum, stats.began)
        given = jnp.where(begins, 0.0, stats.given)
        lacking = jnp.where(
            begins, 0.0, jnp.maximum(stats.lacking, length(momentum - began - given))
        )
        return dataclasses.replace(
            super().update(stats, sensed, torque, params, goal),
            began=began,
            given=given + push,
            exchanged=jnp.where(begins, 0.0, stats.exchanged) + length(push),
            lacking=lacking,
        )

    def evaluate(self, stats: SwimStats, settings: SwimConfig) -> Mapping[str, jax.Array]:
        """The speed; its loss by overlap, of the rest by foreign momentum, of that by curves."""
        speed = self.speed(stats, settings)
        earned = jnp.maximum(speed, 0.0)
        inside = share_lost(stats.overlap / settings.overlap)
        share = stats.lacking / jnp.maximum(stats.exchanged, LITTLE)
        elsewhere = (1 - inside) * share_lost(share / settings.elsewhere)
        curve = (1 - inside - elsewhere) * self.curved(stats)
        return {
            "speed": speed,
            "overlap": earned * inside,
            "elsewhere": earned * elsewhere,
            "curve": earned * curve,
        }
