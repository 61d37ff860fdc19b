"""Jumping as a task of bodies that grow: to have all of oneself as high above the ground as possible,
over and over.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.tasks import base as protocol
from mjxgait.tasks.modular.config import JumpConfig, JumpWeights
from mjxgait.tasks.modular.task import BlocksTask, lost
from mjxgait.types import Sensed, pytree

SHARPNESS = 3
"""By how much later than a walker's a depth costs, and more from there on. Whoever falls from a height
is in the ground for a moment, as deep as the root of that height: at a walker's price no jump above
a tenth of a metre is worth more.
"""


SPANS = 2
"""Of the time that counts; in each of them it is to jump. Once in eight seconds somebody comes off the
ground by chance, as high as those that are meant to, and only in the trial that it was chosen in.
"""


@pytree
class Tally(protocol.Tally):
    """See `protocol.Tally`. heights: [SPANS] m, the greatest of its lowest part in each."""

    heights: jax.Array


class Jump(BlocksTask):
    """See `Task`: on land."""

    Settings: ClassVar[type] = JumpConfig
    terms = tuple(field.name for field in dataclasses.fields(JumpWeights))
    outcomes = ("height", "seconds")

    def init(self) -> Tally:
        """See `Task`."""
        none = jnp.zeros((), jnp.int32)
        return Tally(none, none, jnp.zeros(()), jnp.zeros(SPANS))

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Tally:
        """See `Task`."""
        assert sensed.sunk is not None
        begins, low = tally.steps <= standards, jnp.min(sensed.geom_low)
        span = SPANS * (tally.steps - standards) // jnp.maximum(self.horizon - standards, 1)
        now = (jnp.arange(SPANS) == span) & ~begins
        return dataclasses.replace(
            tally,
            steps=tally.steps + 1,
            overlap=jnp.where(begins, tally.overlap, jnp.maximum(tally.overlap, sensed.sunk)),
            heights=jnp.where(now, jnp.maximum(tally.heights, low), tally.heights),
        )

    def judge(self, tally: Tally, settings: JumpConfig) -> Mapping[str, jax.Array]:
        """See `Task`: m; what of it is lost by blocks that stand in each other or in the ground; and
        of the rest by an end before the end, for the wildest leap is the last.
        """
        height = jnp.mean(tally.heights)
        inside = lost((tally.overlap / settings.overlap) ** SHARPNESS)
        lived = (1 - inside) * tally.steps / self.horizon
        return {
            "height": height,
            "overlap": height * inside,
            "wild": height * (1 - inside - lived),
        }

    def outcome(self, tally: Tally) -> Mapping[str, jax.Array]:
        """See `Task`: m, and s until the end."""
        return {"height": jnp.mean(tally.heights), "seconds": tally.steps * self.step}
