"""Tasks for modular bodies: swim, roam, jump; start at rest, any plausible motion counts.

Physically implausible motion ends the episode. Nothing counts until the body has settled. A way is
that of the centre of mass: bending moves the root, but not the whole body.

Falling over also covers distance, once. So distance counts only after settling, and tipping over
from there costs.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.physics.batched_trees.tree import ModularSensed
from mjxgait.tasks.base import EpisodeStats
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.modular.config import (
    BlocksConfig,
    JumpConfig,
    JumpWeights,
    RoamConfig,
    RoamWeights,
    SwimConfig,
    SwimWeights,
)
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.starts import NEVER, Starts, half_widths
from mjxgait.tasks.terms import ramp
from mjxgait.types import Sensed, pytree

WILD = 1
"""Reason for an early end: faster than anything alive, or bent past the range of a joint."""
FASTEST_HINGE, FASTEST, FURTHEST = 20.0, 5.0, 0.08
"""rad/s, m/s, rad past a hinge's range."""


def own(sensed: Sensed) -> ModularSensed:
    """Return the quantities that only modular bodies have."""
    assert isinstance(sensed.body, ModularSensed)
    return sensed.body


@pytree
class GoingStats(EpisodeStats):
    """Extension of `EpisodeStats`.

    settled, place: [3] m, centre of mass when counting began, and now.
    light: [3] m, its place. since: [] step from which the way counts. None without a light.
    """

    settled: jax.Array
    place: jax.Array
    light: jax.Array | None
    since: jax.Array | None


class BlocksTask(PlainTask):
    """Implementation of `Task`.

    The creature lies at rest, with bent joints in all trials but the first.
    """

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """The root is at the origin; growing the body puts it on the ground."""
        count, joints = settings.starts, len(self.creature.joints.names)
        drawn = jax.random.uniform(key, (count, joints), minval=-1.0)
        bent = half_widths(settings.joint_noise, count) * drawn
        root = np.zeros((count, 7), np.float32)
        root[:, 3] = 1.0
        still = jnp.asarray(np.zeros((count, self.creature.nv), np.float32))
        usual = jnp.asarray(np.ones((count, joints), np.float32))
        return Starts(
            qpos=jnp.concatenate([root, bent], axis=1),
            qvel=still,
            friction=jnp.asarray(np.ones(count, np.float32)),
            push=still,
            push_step=jnp.asarray(np.full(count, NEVER, np.int32)),
            stiffness=usual,
            damping=usual,
        )

    def params(self, settings: BlocksConfig) -> jax.Array:
        """The first step [] that counts."""
        return jnp.round(settings.settle / self.step).astype(jnp.int32)

    @override
    def ended(self, sensed: Sensed, goal: object) -> jax.Array:
        speed = jnp.sqrt(jnp.sum(sensed.trunk_vel**2))
        wild = (jnp.max(jnp.abs(sensed.joint_vel)) > FASTEST_HINGE) | (speed > FASTEST)
        return jnp.where(wild | (own(sensed).limit_excess > FURTHEST), WILD, Reason.FINISHED)

    def weights(self, settings: Any, generation: jax.Array) -> Mapping[str, jax.Array]:
        """The first term is a reward, all others are penalties.

        The weight of the overlap grows over the generations.
        """
        counts = {name: getattr(settings.weights, name) for name in self.terms}
        share = ramp(settings.apart, lambda now: now / settings.apart)(generation)
        counts["overlap"] = counts["overlap"] * share
        wanted = self.terms[0]
        return {n: jnp.asarray(c) if n == wanted else -jnp.asarray(c) for n, c in counts.items()}


class GoingTask(BlocksTask):
    """Implementation of `Task`: get as far as possible.

    axes: number of world axes along which a way counts. dark: light of the empty statistics.
    """

    outcomes: ClassVar[tuple[str, ...]] = ("way", "seconds")
    axes: ClassVar[int] = 3
    dark: ClassVar[np.ndarray | None] = None

    def way(self, stats: GoingStats) -> jax.Array:
        """Straight-line distance [] in m from where counting began."""
        return length((stats.place - stats.settled)[: self.axes])

    def begun(self) -> dict[str, Any]:
        """Empty statistics common to these tasks."""
        none, nowhere = jnp.zeros((), jnp.int32), jnp.zeros(3)
        return {
            "steps": none,
            "reason": none,
            "overlap": jnp.zeros(()),
            "settled": nowhere,
            "place": nowhere,
            "light": None if self.dark is None else jnp.asarray(self.dark),
            "since": None if self.dark is None else none,
        }

    def update(
        self, stats: Any, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Any
    ) -> Any:
        """The place now, and when counting began."""
        return dataclasses.replace(
            stats,
            steps=stats.steps + 1,
            settled=jnp.where(stats.steps <= params, own(sensed).com, stats.settled),
            place=own(sensed).com,
        )

    def speed(self, stats: GoingStats, settings: BlocksConfig) -> jax.Array:
        """Speed [] in m/s over the time that counts, even if the episode ended early."""
        return self.way(stats) / jnp.maximum(self.horizon * self.step - settings.settle, self.step)

    def outcome(self, stats: GoingStats) -> Mapping[str, jax.Array]:
        """Distance in m from where counting began, and s until the end."""
        return {"way": self.way(stats), "seconds": stats.steps * self.step}


def length(vector: jax.Array) -> jax.Array:
    """Length [] of a vector."""
    return jnp.sqrt(jnp.sum(vector * vector))


def lost(much: jax.Array) -> jax.Array:
    """Share lost to a flaw of this size; one half at 1."""
    return 1 - 1 / (1 + much * much)


LITTLE = 1e-6
"""Least divisor: momentum exchanged with the water in kg·m/s, squared joint speeds in (rad/s)²."""
SHARPNESS = 3
"""Exponent of the cost of vibration and of a jumper's depth: little costs less, much costs more.

A fall presses the body into the ground for a moment, to a depth that grows as the square root of
its height. At the cost of walking no jump above a tenth of a metre would be worth more.
"""


@pytree
class SwimStats(GoingStats):
    """Extension of `GoingStats`.

    began: [3] kg·m/s, momentum of the body when counting began.
    given: [3] kg·m/s, from the water since then. exchanged: [] the same without directions.
    lacking: [] kg·m/s, the most that the water did not give.
    """

    began: jax.Array
    given: jax.Array
    exchanged: jax.Array
    lacking: jax.Array


class Swim(GoingTask):
    """Implementation of `Task`: in water, without a floor. The way is a straight line."""

    Settings: ClassVar[type] = SwimConfig
    terms = tuple(field.name for field in dataclasses.fields(SwimWeights))

    @override
    def init(self) -> SwimStats:
        nothing, nowhere = jnp.zeros(()), jnp.zeros(3)
        return SwimStats(
            **self.begun(), began=nowhere, given=nowhere, exchanged=nothing, lacking=nothing
        )

    @override
    def update(
        self, stats: SwimStats, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Any
    ) -> SwimStats:
        begins, momentum, push = (
            stats.steps <= params,
            own(sensed).momentum,
            own(sensed).water_force * self.step,
        )
        began = jnp.where(begins, momentum, stats.began)
        given = jnp.where(begins, 0.0, stats.given)
        lacking = jnp.where(
            begins, 0.0, jnp.maximum(stats.lacking, length(momentum - began - given))
        )
        return dataclasses.replace(
            super().update(stats, sensed, torque, params, goal),
            began=began,
            given=given + push,
            exchanged=jnp.where(begins, 0.0, stats.exchanged) + length(push),
            lacking=lacking,
        )

    def evaluate(self, stats: SwimStats, settings: SwimConfig) -> Mapping[str, jax.Array]:
        """The speed; its loss by overlap; the loss of the rest by foreign momentum."""
        speed = self.speed(stats, settings)
        earned = jnp.maximum(speed, 0.0)
        inside = lost(stats.overlap / settings.overlap)
        share = stats.lacking / jnp.maximum(stats.exchanged, LITTLE)
        elsewhere = (1 - inside) * lost(share / settings.elsewhere)
        return {"speed": speed, "overlap": earned * inside, "elsewhere": earned * elsewhere}


@pytree
class RoamStats(GoingStats):
    """Extension of `GoingStats`.

    upwards: [3] direction in the root's axes that was up when counting began.
    upright: [] least cosine of its angle with the world's up axis since then.
    joint_vel: [J] rad/s, at the last step. moved: [] sum of its squares over joints and steps since
    then. jerked: [] the same of its changes from step to step.
    """

    upwards: jax.Array
    upright: jax.Array
    joint_vel: jax.Array
    moved: jax.Array
    jerked: jax.Array


class Roam(GoingTask):
    """Implementation of `Task`: on land. The way is a straight, level line."""

    Settings: ClassVar[type] = RoamConfig
    terms = tuple(field.name for field in dataclasses.fields(RoamWeights))
    axes = 2

    @override
    def init(self) -> RoamStats:
        joints, none = jnp.zeros(len(self.creature.joints.names)), jnp.zeros(())
        return RoamStats(
            **self.begun(),
            upwards=jnp.zeros(3),
            upright=jnp.ones(()),
            joint_vel=joints,
            moved=none,
            jerked=none,
        )

    @override
    def update(
        self, stats: RoamStats, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Any
    ) -> RoamStats:
        begins = stats.steps <= params
        upwards = jnp.where(begins, sensed.trunk_rot[2], stats.upwards)
        upright = jnp.sum(sensed.trunk_rot[2] * upwards)
        changes = sensed.joint_vel - stats.joint_vel
        return dataclasses.replace(
            super().update(stats, sensed, torque, params, goal),
            overlap=jnp.where(begins, stats.overlap, jnp.maximum(stats.overlap, own(sensed).depth)),
            upwards=upwards,
            upright=jnp.where(begins, 1.0, jnp.minimum(stats.upright, upright)),
            joint_vel=sensed.joint_vel,
            moved=jnp.where(begins, 0.0, stats.moved + jnp.sum(sensed.joint_vel**2)),
            jerked=jnp.where(begins, 0.0, stats.jerked + jnp.sum(changes**2)),
        )

    def evaluate(self, stats: RoamStats, settings: RoamConfig) -> Mapping[str, jax.Array]:
        """The speed; its loss by overlap; of the rest by tipping over, of that rest by vibration.

        Blocks overlap each other or the ground.
        """
        speed = self.speed(stats, settings)
        earned = jnp.maximum(speed, 0.0)
        inside = lost(stats.overlap / settings.overlap)
        tilt = jnp.degrees(jnp.arccos(jnp.clip(stats.upright, -1.0, 1.0)))
        tipped = (1 - inside) * lost(tilt / settings.tilt)
        shaken = jnp.sqrt(stats.jerked / jnp.maximum(stats.moved, LITTLE))
        vibrates = (1 - inside - tipped) * lost((shaken / settings.vibration) ** SHARPNESS)
        return {
            "speed": speed,
            "overlap": earned * inside,
            "balance": earned * tipped,
            "vibration": earned * vibrates,
        }


SPANS = 2
"""Spans of the time that counts; the body must jump in each.

Once in eight seconds some individual leaves the ground by chance, as high as real jumpers, and only
in the trial that it was selected by.
"""


@pytree
class JumpStats(EpisodeStats):
    """Extension of `EpisodeStats`.

    heights: [SPANS] m, greatest height of the lowest part in each.
    """

    heights: jax.Array


class Jump(BlocksTask):
    """Implementation of `Task`: on land."""

    Settings: ClassVar[type] = JumpConfig
    terms = tuple(field.name for field in dataclasses.fields(JumpWeights))
    outcomes = ("height", "seconds")

    @override
    def init(self) -> JumpStats:
        none = jnp.zeros((), jnp.int32)
        return JumpStats(none, none, jnp.zeros(()), jnp.zeros(SPANS))

    @override
    def update(
        self, stats: JumpStats, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: object
    ) -> JumpStats:
        begins, low = stats.steps <= params, jnp.min(sensed.geom_low)
        span = SPANS * (stats.steps - params) // jnp.maximum(self.horizon - params, 1)
        now = (jnp.arange(SPANS) == span) & ~begins
        return dataclasses.replace(
            stats,
            steps=stats.steps + 1,
            overlap=jnp.where(begins, stats.overlap, jnp.maximum(stats.overlap, own(sensed).depth)),
            heights=jnp.where(now, jnp.maximum(stats.heights, low), stats.heights),
        )

    def evaluate(self, stats: JumpStats, settings: JumpConfig) -> Mapping[str, jax.Array]:
        """Height in m; its loss by overlap; the loss of the rest by an early end.

        Blocks overlap each other or the ground. An early end costs, because the wildest leap is the
        last.
        """
        height = jnp.mean(stats.heights)
        inside = lost((stats.overlap / settings.overlap) ** SHARPNESS)
        lived = (1 - inside) * stats.steps / self.horizon
        return {
            "height": height,
            "overlap": height * inside,
            "wild": height * (1 - inside - lived),
        }

    def outcome(self, stats: JumpStats) -> Mapping[str, jax.Array]:
        """Height in m, and s until the end."""
        return {"height": jnp.mean(stats.heights), "seconds": stats.steps * self.step}
