"""Following as a task of bodies that grow: to get nearer to a light, wherever it is.

Each trial has a light of its own, too far away to be reached. A brain senses its direction in the
own axes of each block.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.champion.blocks.material import LIGHT
from mjxgait.creature import Creature
from mjxgait.settings.rollout import RolloutConfig
from mjxgait.tasks.blocks.alive import GoingTask, length
from mjxgait.tasks.blocks.roam import Roam
from mjxgait.tasks.blocks.swim import Swim
from mjxgait.tasks.trials import Starts
from mjxgait.types import Sensed

GOLDEN = np.pi * (3 - np.sqrt(5.0))
"""rad; so turned one after another, directions are spread evenly about an axis."""


class Following(GoingTask):
    """See `Task`: what followers in water and on land have in common. A way is what the distance to
    the light has become less by.
    """

    adds: ClassVar[tuple[str, ...]] = ("light",)
    dark = np.zeros(3, np.float32)

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`: the first light is ahead, the others are spread evenly around."""
        lights = LIGHT * directions(settings.starts, self.axes)
        plain = super().trials(key, creature, settings)
        return dataclasses.replace(plain, light=jnp.asarray(lights, jnp.float32))

    def aim(self, trial: Starts) -> jax.Array:
        """See `Task`: [3] m, where the light is."""
        assert trial.light is not None
        return trial.qpos[:3] + trial.light

    def senses(self, aim: jax.Array, sensed: Sensed) -> Mapping[str, jax.Array]:
        """See `Task`: [G, 3] the light's direction in the own axes of each block."""
        assert sensed.geom_rot is not None
        there = aim - sensed.geom_pos
        there = there / jnp.sqrt(jnp.sum(there**2, axis=1, keepdims=True))
        return {"light": jnp.sum(sensed.geom_rot * there[:, None], axis=2)}

    def update(
        self, tally: Any, sensed: Sensed, torque: jax.Array, standards: Any, aim: jax.Array
    ) -> Any:
        """See `Task`."""
        after = super().update(tally, sensed, torque, standards, aim)
        return dataclasses.replace(after, light=aim)

    def way(self, tally: Any) -> jax.Array:
        """See `GoingTask`."""
        before, now = (
            length((tally.light - place)[: self.axes]) for place in (tally.settled, tally.place)
        )
        return before - now


class FollowInWater(Following, Swim):
    """See `Task`."""


class FollowOnLand(Following, Roam):
    """See `Task`."""


def directions(count: int, axes: int) -> np.ndarray:
    """[count, 3] of length 1, the first along x: all around in the plane, or on the sphere."""
    place = np.arange(count)
    if axes == 2:
        angle = 2 * np.pi * place / count
        return np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    ahead = 1 - 2 * place / max(count - 1, 1)
    aside = np.sqrt(1 - ahead**2)
    return np.stack([ahead, aside * np.cos(GOLDEN * place), aside * np.sin(GOLDEN * place)], axis=1)
