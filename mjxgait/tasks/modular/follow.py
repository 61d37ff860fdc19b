"""Follow task for modular bodies: get nearer to a light, wherever it is.

Each trial has its own light, too far away to be reached, which may move to another side once. The
brain observes its direction in the axes of each block.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from mjxgait.config.schema import RolloutConfig
from mjxgait.controllers.sims_brain.controller import directions
from mjxgait.controllers.sims_brain.reference_body import LIGHT
from mjxgait.creature import Creature
from mjxgait.tasks.modular.base import LocomotionTask, length
from mjxgait.tasks.modular.roam import Roam
from mjxgait.tasks.modular.swim import Swim
from mjxgait.tasks.starts import NEVER, Starts
from mjxgait.types import Sensed, pytree


@pytree
class Light:
    """Light of a trial.

    place: [3] m; as a trial's goal, from where the root starts. later: [3] m, its place after it
    moved. steps: [] until it moves.
    """

    place: jax.Array
    later: jax.Array
    steps: jax.Array


class Following(LocomotionTask):
    """Implementation of `Task`: base class for following in water and on land.

    The way is the decrease of the distance to the light, wherever it was.
    """

    adds: ClassVar[tuple[str, ...]] = ("light",)
    outcomes = (*LocomotionTask.outcomes, "since")
    dark = np.zeros(3, np.float32)

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """The first light is ahead, and in each round the others are elsewhere.

        The lights of a round cancel out with the one ahead: moving straight on gains as much on
        some as it loses on the others. With `moves` the others change places, so they still do.
        """
        rounds = settings.variety
        others = (settings.starts - 1) // rounds
        keys = jax.random.split(jax.random.fold_in(key, 6), rounds)
        drawn = jax.vmap(lambda key: balanced(key, others, self.axes))(keys)
        moves = round(settings.moves / self.step) if settings.moves else NEVER
        goal = Light(
            place=_lights(drawn),
            later=_lights(jnp.roll(drawn, 1, axis=1)),
            steps=jnp.full(settings.starts, moves, jnp.int32).at[0].set(NEVER),
        )
        return dataclasses.replace(super().trials(key, creature, settings), goal=goal)

    def goal(self, trial: Starts) -> Light:
        """The light at its places in the world."""
        start, light = trial.qpos[:3], trial.goal
        return Light(start + light.place, start + light.later, jnp.asarray(light.steps))

    @override
    def next_goal(self, goal: Light, sensed: Sensed) -> Light:
        place = jnp.where(goal.steps == 1, goal.later, goal.place)
        return dataclasses.replace(goal, place=place, steps=goal.steps - 1)

    def observations(self, goal: Light, sensed: Sensed) -> Mapping[str, jax.Array]:
        """Direction [G, 3] of the light in the axes of each block."""
        return {"light": directions(goal.place, sensed)}

    @override
    def update(
        self, stats: Any, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Light
    ) -> Any:
        """A move of the light ends the way to its old place; the next begins there and then."""
        moved = jnp.any(stats.light != goal.place) & (stats.steps > params)
        gained = jnp.where(moved, self.way(stats), stats.gained)
        settled = jnp.where(moved, stats.place, stats.settled)
        after = super().update(
            dataclasses.replace(stats, settled=settled), sensed, torque, params, goal
        )
        return dataclasses.replace(after, light=goal.place, gained=gained, since=params)

    @override
    def way(self, stats: Any) -> jax.Array:
        before, now = (
            length((stats.light - place)[: self.axes]) for place in (stats.settled, stats.place)
        )
        return stats.gained + (before - now)

    @override
    def curved(self, stats: Any) -> jax.Array:
        """None: a follower has to turn."""
        return jnp.zeros(())

    def outcome(self, stats: Any) -> Mapping[str, jax.Array]:
        """Also the time in s from which the way counted."""
        return {**super().outcome(stats), "since": stats.since * self.step}


class FollowInWater(Following, Swim):
    """Implementation of `Task`."""


class FollowOnLand(Following, Roam):
    """Implementation of `Task`."""


def _lights(others: jax.Array) -> jax.Array:
    """Places [R, 3] m of the one ahead and of the others [rounds, others, 3]."""
    return LIGHT * jnp.vstack([jnp.array([[1.0, 0.0, 0.0]]), others.reshape(-1, 3)])


def balanced(key: jax.Array, count: int, axes: int) -> jax.Array:
    """Directions [count, 3] that cancel out together with the one ahead, along so many axes.

    Up to two, in space up to three, form a ring around the forward axis, far enough behind to
    balance the one ahead (a single one is straight behind). The rest are opposite pairs in random
    directions. In space the ring is rotated at random, and half of the rings of three become one
    direction behind and two perpendicular to the forward axis.
    """
    key_turn, key_which = jax.random.split(key)
    most = 3 if axes == 3 else 1
    ring = min(count, most if count % 2 else 2)
    turn = jax.random.uniform(key_turn, maxval=2 * jnp.pi) if axes == 3 else 0.0
    first = _ring(ring, -1 / max(ring, 1), turn)
    if ring == 3:
        cross = jnp.vstack([_ring(1, -1.0, turn), _ring(2, 0.0, turn)])
        first = jnp.where(jax.random.bernoulli(key_which), first, cross)
    one = jax.random.normal(jax.random.fold_in(key, 1), ((count - ring) // 2, 3))
    one = one.at[:, axes:].set(0.0)
    one = one / jnp.linalg.norm(one, axis=1, keepdims=True)
    return jnp.vstack([first, one, -one])


def _ring(count: int, ahead: float, turn: jax.Array | float) -> jax.Array:
    """Unit vectors [count, 3] evenly around the forward axis, `ahead` along it.

    turn: rad, of the first.
    """
    about = turn + 2 * jnp.pi * jnp.arange(count) / max(count, 1)
    aside = float(np.sqrt(1 - ahead**2))
    along = jnp.full(count, ahead)
    return jnp.stack([along, aside * jnp.cos(about), aside * jnp.sin(about)], axis=1)
