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
from mjxgait.tasks.score import hardness
from mjxgait.tasks.trials import Starts
from mjxgait.types import Sensed

GOLDEN = np.pi * (3 - np.sqrt(5.0))
"""rad; so turned one after another, directions are spread evenly about an axis."""

LEAST = 0.7
"""With several rounds a light is at 0.7 to 1 of its usual angle from ahead."""
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
        """See `Task`: the first light is ahead, the others are spread evenly around; where there are
        several rounds of them, each is turned about the way ahead, and they are nearer to it.
        """
        rounds = settings.variety
        ahead, *others = LIGHT * directions(1 + (settings.starts - 1) // rounds, self.axes)
        lights = jnp.tile(jnp.array(others).reshape(-1, 3), (rounds, 1))
        if rounds > 1:
            lights = self._moved(jax.random.fold_in(key, 6), lights, rounds)
        plain = super().trials(key, creature, settings)
        return dataclasses.replace(plain, light=jnp.vstack([ahead, lights]).astype(jnp.float32))

    def _moved(self, key: jax.Array, lights: jax.Array, rounds: int) -> jax.Array:
        """The lights [n, 3] of several rounds, as far from ahead as chance has it; all of a round
        turned together, in the plane to the one side or to the other.
        """
        key_share, key_turn = jax.random.split(key)
        turn = jax.random.uniform(key_turn, (rounds,), maxval=2 * jnp.pi)
        if self.axes == 2:
            turn = jnp.pi * jnp.round(turn / (2 * jnp.pi))
        share = jax.random.uniform(key_share, (len(lights),), minval=LEAST)
        return _aside(lights, share, jnp.repeat(turn, len(lights) // rounds))

    def levels(self, settings: Any) -> jax.Array | int:
        """See `Task`."""
        steps: jax.Array | int = settings.widening
        return steps

    def harder(self, trials: Starts, settings: Any, level: jax.Array) -> Starts:
        """See `Task`: lights spread, so that whoever gets on learns to turn little by little."""
        spread = hardness(settings.widening, level)
        assert trials.light is not None
        return dataclasses.replace(trials, light=_aside(trials.light, spread, 0.0))

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


def directions(count: int, axes: int) -> np.ndarray:
    """[count, 3] of length 1, the first along x: all around in the plane, or on the sphere."""
    place = np.arange(count)
    if axes == 2:
        turn = 2 * np.pi * place / count
        return np.stack([np.cos(turn), np.sin(turn), np.zeros(count)], axis=1)
    angle = np.arccos(1 - 2 * place / max(count - 1, 1))
    about = GOLDEN * place
    aside = np.sin(angle)
    return np.stack([np.cos(angle), aside * np.cos(about), aside * np.sin(about)], axis=1)


def _aside(lights: jax.Array, share: jax.Array, turn: jax.Array | float) -> jax.Array:
    """Lights [n, 3] at a share [n] of their angles from ahead, turned about that axis by rad [n]."""
    left, up = lights[:, 1], lights[:, 2]
    angle = share * jnp.arctan2(jnp.hypot(left, up), lights[:, 0])
    about = jnp.arctan2(up, left) + turn
    aside = jnp.sin(angle)
    found = [jnp.cos(angle), aside * jnp.cos(about), aside * jnp.sin(about)]
    return jnp.linalg.norm(lights, axis=1, keepdims=True) * jnp.stack(found, axis=1)
