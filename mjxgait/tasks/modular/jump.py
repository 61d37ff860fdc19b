"""Jump task for modular bodies: lift the whole body as high as possible, over and over."""

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
"""Exponent of the cost of depth: small depths cost less than in walking, large ones more.

A fall presses the body into the ground for a moment, to a depth that grows as the square root of
its height. At the cost of walking no jump above a tenth of a metre would be worth more.
"""


SPANS = 2
"""Spans of the time that counts; the body must jump in each.

Once in eight seconds some individual leaves the ground by chance, as high as real jumpers, and only
in the trial that it was selected by.
"""


@pytree
class Tally(protocol.Tally):
    """See `protocol.Tally`. heights: [SPANS] m, greatest height of the lowest part in each."""

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
        """See `Task`: m; its loss by overlap; the loss of the rest by an early end.

        Blocks overlap each other or the ground. An early end costs, because the wildest leap is the
        last.
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
