"""Limbo task: reach a goal beneath a bar, with every part clear of the bar."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from mjxgait.config.schema import RolloutConfig
from mjxgait.controllers.observations import forward_way
from mjxgait.creature import Creature
from mjxgait.creature.body import Body
from mjxgait.creature.ground.spec import parse_ground
from mjxgait.errors import UserError
from mjxgait.tasks.hop.config import (
    BAR_PLACE,
    BAR_RADIUS,
    LIMBO_GOALS,
    LIMBO_NOMINAL_GOAL,
    LimboConfig,
)
from mjxgait.tasks.hop.fitness import MISSED, fitness_terms
from mjxgait.tasks.hop.stats import HopParams, HopStats
from mjxgait.tasks.hop.task import Hop
from mjxgait.tasks.starts import Starts
from mjxgait.tasks.terms import ramped
from mjxgait.types import Sensed, pytree

SLOPES = np.tan(np.radians(np.arange(-80, 81, 10))).astype(np.float32)[:, None]
"""Slopes [slopes, 1] of the lines that are laid on the body from above."""
MARGIN = 0.01
"""Required margin in m: decorative parts stick out of the watched geoms."""


def bar_distance(creature: Body, sensed: Sensed) -> jax.Array:
    """Distance [] in m to the bar along the start's forward axis; negative beyond it."""
    return BAR_PLACE - forward_way(creature, sensed)


def intrusion(creature: Body, sensed: Sensed, height: jax.Array | float) -> jax.Array:
    """Height [] in m of the body's hull above a bar of this height [] m, at the bar.

    The hull is that of the watched geoms, each taken as a ball of the same height; rods and springs
    that join them lie within. It is the space below all lines that rest on it from above, of which
    some are laid (`SLOPES`). Where they miss an edge, the hull is slightly too large. Flying over
    the bar counts no less than running into it. The floor must be the plane z = 0.
    """
    forward, _ = creature.frame.start_axes
    from_trunk = (sensed.geom_pos - sensed.trunk_pos) @ forward
    ahead, up = from_trunk - bar_distance(creature, sensed), sensed.geom_pos[:, 2]
    radius = up - sensed.geom_low + (BAR_RADIUS + MARGIN)
    lines = up - SLOPES * ahead + jnp.sqrt(1 + SLOPES**2) * radius
    top = jnp.min(jnp.max(lines, axis=1))
    return jnp.maximum(top - (height + BAR_RADIUS), 0.0)


DEEP = 0.3
"""Depth in the bar, in hip heights, at which the penalty is full."""
THERE, BENEATH = 0.6, 0.05
"""Largest means over the trials of the terms `missed` and `bar` at which the bar is lowered."""


@pytree
class LimboGoal:
    """Goal and bar of one trial.

    ahead: [] m from the start to the goal. raised: [] m by which the bar is above its final height.
    """

    ahead: jax.Array
    raised: jax.Array


@pytree
class LimboStats(HopStats):
    """Extension of `HopStats`.

    bar: [] m, greatest depth in the bar at its final height.
    raised: [] m of it that cost nothing yet.
    height: [] m, of the bar in the end.
    """

    bar: jax.Array
    raised: jax.Array
    height: jax.Array


@pytree
class LimboParams(HopParams):
    """Extension of `HopParams`. height: [] m, of the bar."""

    height: jax.Array


class Limbo(Hop):
    """Path of one creature to a goal beneath a bar; see `Hop`."""

    Settings = LimboConfig
    outcomes = (*Hop.outcomes, "bar")
    adds = (*Hop.adds, "bar_distance")
    has_curriculum = True
    goals, nominal = LIMBO_GOALS, LIMBO_NOMINAL_GOAL

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`.

        Raises:
          UserError: the ground is not flat, so a bar has no single height.
        """
        if not parse_ground(settings.ground).flat:
            raise UserError(
                f"rollout.ground = {settings.ground}: task limbo needs flat ground; leave "
                "rollout.ground out"
            )
        starts = super().trials(key, creature, settings)
        return dataclasses.replace(starts, goal=LimboGoal(starts.goal, jnp.zeros(settings.starts)))

    @override
    def levels(self, settings: LimboConfig) -> jax.Array | int:
        steps: jax.Array | int = settings.lowering
        return steps

    def at_level(self, trials: Starts, settings: LimboConfig, level: jax.Array) -> Starts:
        """The bar comes down, so that hoppers learn to duck little by little."""
        left = 1.0 - ramped(settings.lowering, level)
        raised = jnp.full(trials.friction.shape, settings.higher * left)
        return dataclasses.replace(trials, goal=LimboGoal(trials.goal.ahead, raised))

    def level_passed(self, terms: Mapping[str, jax.Array]) -> jax.Array:
        """At the goal in the end, and hardly in the bar."""
        return (terms[MISSED] <= THERE) & (terms["bar"] <= BENEATH)

    @override
    def goal(self, trial: Starts) -> Any:
        return jax.tree.map(jnp.asarray, trial.goal)

    @override
    def params(self, settings: Any) -> LimboParams:
        height = jnp.asarray(settings.height, jnp.float32)
        return LimboParams(**vars(super().params(settings)), height=height)

    @override
    def observations(self, goal: Any, sensed: Sensed) -> dict[str, jax.Array]:
        return super().observations(goal.ahead, sensed) | {
            "bar_distance": bar_distance(self.creature, sensed)
        }

    @override
    def init(self) -> LimboStats:
        none = jnp.zeros(())
        return LimboStats(**vars(super().init()), bar=none, raised=none, height=none)

    @override
    def update(self, stats: Any, sensed: Sensed, torque: jax.Array, params: Any, goal: Any) -> Any:
        after: Any = super().update(stats, sensed, torque, params, goal.ahead)
        deepest = jnp.maximum(stats.bar, intrusion(self.creature, sensed, params.height))
        return dataclasses.replace(after, bar=deepest, raised=goal.raised, height=params.height)

    @override
    def evaluate(self, stats: Any, settings: object) -> dict[str, jax.Array]:
        deep = jnp.maximum(stats.bar - stats.raised, 0.0)
        bar = jnp.minimum(deep / (DEEP * self.creature.frame.hip_height), 1.0)
        return fitness_terms(self.creature, self.horizon, stats, {"bar": bar})

    def outcome(self, stats: Any) -> dict[str, jax.Array]:
        """Metrics of a hop, and the height in m of a bar that would just be cleared.

        It is at least the height of the bar itself.
        """
        return super().outcome(stats) | {"bar": stats.height + stats.bar}
