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
from mjxgait.settings.blocks import FollowInWaterConfig, FollowOnLandConfig
from mjxgait.settings.rollout import RolloutConfig
from mjxgait.tasks.blocks.alive import GoingTask, length
from mjxgait.tasks.blocks.roam import Roam
from mjxgait.tasks.blocks.swim import Swim
from mjxgait.tasks.trials import Starts
from mjxgait.types import Sensed

GOLDEN = np.pi * (3 - np.sqrt(5.0))
"""rad; so turned one after another, directions are spread evenly about an axis."""

READY = 0.05
"""m/s by which lights come nearer, mean over the trials: who does it is ready for wider ones. Who is
faster by then has become one family, and learns to turn no more."""


class Following(GoingTask):
    """See `Task`: what followers in water and on land have in common. A way is what the distance to
    the light has become less by.
    """

    adds: ClassVar[tuple[str, ...]] = ("light",)
    outcomes = (*GoingTask.outcomes, "aside", "since")
    climbs = True
    dark = np.zeros(3, np.float32)

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`: the first light is ahead, the others are spread evenly around."""
        lights = LIGHT * directions(settings.starts, self.axes)
        plain = super().trials(key, creature, settings)
        return dataclasses.replace(plain, light=jnp.asarray(lights, jnp.float32))

    def levels(self, settings: Any) -> jax.Array | int:
        """See `Task`."""
        steps: jax.Array | int = settings.widening
        return steps

    def harder(self, trials: Starts, settings: Any, level: jax.Array) -> Starts:
        """See `Task`: lights spread, so that whoever gets on learns to turn little by little."""
        steps = settings.widening
        spread = jnp.where(level < steps, (level + 1) / (steps + 1), 1.0)
        lights = LIGHT * directions(trials.friction.shape[0], self.axes, spread)
        return dataclasses.replace(trials, light=lights.astype(jnp.float32))

    def mastered(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """See `Task`."""
        wanted, *penalties = (terms[name] for name in self.terms)
        return wanted - sum(penalties) >= READY

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
        return dataclasses.replace(after, light=aim, since=standards)

    def way(self, tally: Any) -> jax.Array:
        """See `GoingTask`."""
        before, now = (
            length((tally.light - place)[: self.axes]) for place in (tally.settled, tally.place)
        )
        return before - now

    def outcome(self, tally: Any) -> Mapping[str, jax.Array]:
        """See `Task`: of those that get on, rad from ahead to the light, and s from which on the way
        counted.
        """
        ahead, *others = (tally.light[axis] for axis in range(self.axes))
        aside = jnp.arctan2(length(jnp.stack(others)), ahead)
        return {**super().outcome(tally), "aside": aside, "since": tally.since * self.step}


class FollowInWater(Following, Swim):
    """See `Task`."""

    Settings: ClassVar[type] = FollowInWaterConfig


class FollowOnLand(Following, Roam):
    """See `Task`."""

    Settings: ClassVar[type] = FollowOnLandConfig


def directions(count: int, axes: int, spread: jax.Array | float = 1.0) -> jax.Array:
    """[count, 3] of length 1, the first along x: all around in the plane, or on the sphere; with a
    smaller spread than 1 that share of the angle from x.
    """
    place = np.arange(count)
    if axes == 2:
        turn = 2 * np.pi * place / count
        angle = spread * np.where(turn > np.pi, turn - 2 * np.pi, turn)
        return jnp.stack([jnp.cos(angle), jnp.sin(angle), jnp.zeros(count)], axis=1)
    angle = spread * np.arccos(1 - 2 * place / max(count - 1, 1))
    about = GOLDEN * place
    aside = jnp.sin(angle)
    return jnp.stack([jnp.cos(angle), aside * np.cos(about), aside * np.sin(about)], axis=1)
