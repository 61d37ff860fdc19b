"""Jumping as a task of bodies that grow: to have all of oneself as high above the ground as possible,
once.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.settings.blocks import JumpConfig, JumpWeights
from mjxgait.tasks import protocol
from mjxgait.tasks.blocks.alive import BlocksTask, lost
from mjxgait.types import Sensed, pytree


@pytree
class Tally(protocol.Tally):
    """See `protocol.Tally`. height: [] m, the greatest of its lowest part since counting began."""

    height: jax.Array


class Jump(BlocksTask):
    """See `Task`: on land."""

    Settings: ClassVar[type] = JumpConfig
    terms = tuple(field.name for field in dataclasses.fields(JumpWeights))
    outcomes = ("height", "seconds")

    def init(self) -> Tally:
        """See `Task`."""
        none, nothing = jnp.zeros((), jnp.int32), jnp.zeros(())
        return Tally(none, none, nothing, nothing)

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Tally:
        """See `Task`."""
        assert sensed.sunk is not None
        begins, low = tally.steps <= standards, jnp.min(sensed.geom_low)
        return dataclasses.replace(
            tally,
            steps=tally.steps + 1,
            overlap=jnp.where(begins, tally.overlap, jnp.maximum(tally.overlap, sensed.sunk)),
            height=jnp.where(begins, 0.0, jnp.maximum(tally.height, low)),
        )

    def judge(self, tally: Tally, settings: JumpConfig) -> Mapping[str, jax.Array]:
        """See `Task`: m; what of it is lost by blocks that stand in each other or in the ground; and of
        the rest by an end before the end, for the wildest leap is the last.
        """
        inside = lost(tally.overlap / settings.overlap)
        wild = (1 - inside) * (1 - tally.steps / self.horizon)
        return {
            "height": tally.height,
            "overlap": tally.height * inside,
            "wild": tally.height * wild,
        }

    def outcome(self, tally: Tally) -> Mapping[str, jax.Array]:
        """See `Task`: m, and s until the end."""
        return {"height": tally.height, "seconds": tally.steps * self.step}
