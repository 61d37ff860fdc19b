"""Swim task for modular bodies: get as far as possible after settling, in any way."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.tasks.modular import task as alive
from mjxgait.tasks.modular.config import SwimConfig, SwimWeights
from mjxgait.tasks.modular.task import GoingTask, length, lost
from mjxgait.types import Sensed, pytree

LITTLE = 1e-6
"""Lower bound of the momentum exchanged with the water, in kg·m/s."""


@pytree
class Tally(alive.Tally):
    """See `alive.Tally`.

    began: [3] kg·m/s, momentum of the body when counting began.
    given: [3] kg·m/s, from the water since then. exchanged: [] the same without directions.
    lacking: [] kg·m/s, the most that the water did not give.
    """

    began: jax.Array
    given: jax.Array
    exchanged: jax.Array
    lacking: jax.Array


class Swim(GoingTask):
    """See `Task`: in water, without a floor. The way is a straight line."""

    Settings: ClassVar[type] = SwimConfig
    terms = tuple(field.name for field in dataclasses.fields(SwimWeights))

    def init(self) -> Tally:
        """See `Task`."""
        nothing, nowhere = jnp.zeros(()), jnp.zeros(3)
        return Tally(
            **self.begun(), began=nowhere, given=nowhere, exchanged=nothing, lacking=nothing
        )

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Tally:
        """See `Task`."""
        assert sensed.momentum is not None
        assert sensed.washed is not None
        begins, momentum, push = (
            tally.steps <= standards,
            sensed.momentum,
            sensed.washed * self.step,
        )
        began = jnp.where(begins, momentum, tally.began)
        given = jnp.where(begins, 0.0, tally.given)
        lacking = jnp.where(
            begins, 0.0, jnp.maximum(tally.lacking, length(momentum - began - given))
        )
        return dataclasses.replace(
            super().update(tally, sensed, torque, standards, aim),
            began=began,
            given=given + push,
            exchanged=jnp.where(begins, 0.0, tally.exchanged) + length(push),
            lacking=lacking,
        )

    def judge(self, tally: Tally, settings: SwimConfig) -> Mapping[str, jax.Array]:
        """See `Task`: the speed; its loss by overlap; the loss of the rest by foreign momentum."""
        speed = self.speed(tally, settings)
        earned = jnp.maximum(speed, 0.0)
        inside = lost(tally.overlap / settings.overlap)
        share = tally.lacking / jnp.maximum(tally.exchanged, LITTLE)
        elsewhere = (1 - inside) * lost(share / settings.elsewhere)
        return {"speed": speed, "overlap": earned * inside, "elsewhere": earned * elsewhere}
