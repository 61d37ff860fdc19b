"""Roam task for modular bodies: move over ground as far as possible, in any way.

Falling over also covers distance, once. So distance counts only after settling, and tipping over
from there costs.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.tasks.modular import task as alive
from mjxgait.tasks.modular.config import RoamConfig, RoamWeights
from mjxgait.tasks.modular.task import GoingTask, lost
from mjxgait.types import Sensed, pytree


@pytree
class Tally(alive.Tally):
    """See `alive.Tally`.

    upwards: [3] direction in the root's axes that was up when counting began.
    upright: [] least cosine of its angle with the world's up axis since then.
    """

    upwards: jax.Array
    upright: jax.Array


class Roam(GoingTask):
    """See `Task`: on land. The way is a straight, level line."""

    Settings: ClassVar[type] = RoamConfig
    terms = tuple(field.name for field in dataclasses.fields(RoamWeights))
    axes = 2

    def init(self) -> Tally:
        """See `Task`."""
        return Tally(**self.begun(), upwards=jnp.zeros(3), upright=jnp.ones(()))

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Tally:
        """See `Task`."""
        assert sensed.sunk is not None
        begins = tally.steps <= standards
        upwards = jnp.where(begins, sensed.trunk_rot[2], tally.upwards)
        upright = jnp.sum(sensed.trunk_rot[2] * upwards)
        return dataclasses.replace(
            super().update(tally, sensed, torque, standards, aim),
            overlap=jnp.where(begins, tally.overlap, jnp.maximum(tally.overlap, sensed.sunk)),
            upwards=upwards,
            upright=jnp.where(begins, 1.0, jnp.minimum(tally.upright, upright)),
        )

    def judge(self, tally: Tally, settings: RoamConfig) -> Mapping[str, jax.Array]:
        """See `Task`: the speed; its loss by overlap; the loss of the rest by tipping over.

        Blocks overlap each other or the ground.
        """
        speed = self.speed(tally, settings)
        earned = jnp.maximum(speed, 0.0)
        inside = lost(tally.overlap / settings.overlap)
        tilt = jnp.degrees(jnp.arccos(jnp.clip(tally.upright, -1.0, 1.0)))
        tipped = (1 - inside) * lost(tilt / settings.tilt)
        return {"speed": speed, "overlap": earned * inside, "balance": earned * tipped}
