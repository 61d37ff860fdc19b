"""Base classes of the tasks for modular bodies: start at rest; any plausible motion counts.

Physically implausible motion ends the episode. Distances are those of the centre of mass, because
bending moves the root but not the whole body. They count once the body has settled: a fall covers
some distance, too.
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
from mjxgait.tasks.modular.config import ModularConfig
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.starts import NEVER, Starts, half_widths
from mjxgait.tasks.terms import ramp
from mjxgait.types import Sensed, pytree

WILD = 1
"""Reason for an early end: implausibly fast, or a hinge past its range."""
FASTEST_HINGE, FASTEST, FURTHEST = 20.0, 5.0, 0.08
"""rad/s, m/s, rad past a hinge's range."""
LITTLE = 1e-6
"""Least divisor: momentum exchanged with the water in kg·m/s, squared joint speeds in (rad/s)²."""
NEAR = 1e-6
"""Least product in m² of the two halves of a way that have directions."""
SHARPNESS = 3
"""Exponent of the cost of vibration and of a jumper's depth: little costs less, much costs more.

A fall presses the body into the ground for a moment, to a depth that grows as the square root of
its height. At the cost of walking no jump above a tenth of a metre would be worth more.
"""


def modular_sensed(sensed: Sensed) -> ModularSensed:
    """Return the quantities that only modular bodies have."""
    assert isinstance(sensed.body, ModularSensed)
    return sensed.body


@pytree
class LocomotionStats(EpisodeStats):
    """Extension of `EpisodeStats`.

    settled, halfway, place: [3] m, centre of mass when counting began, after half of the time that
    counts, and now.
    light: [3] m, its place. gained: [] m, way towards its former place. since: [] step from which
    the way counts. None without a light.
    """

    settled: jax.Array
    halfway: jax.Array
    place: jax.Array
    light: jax.Array | None
    gained: jax.Array | None
    since: jax.Array | None


class ModularTask(PlainTask):
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

    def params(self, settings: Any) -> Any:
        """The first step [] that counts."""
        return jnp.round(settings.settle / self.step).astype(jnp.int32)

    @override
    def ended(self, sensed: Sensed, goal: object) -> jax.Array:
        speed = jnp.sqrt(jnp.sum(sensed.trunk_vel**2))
        wild = (jnp.max(jnp.abs(sensed.joint_vel)) > FASTEST_HINGE) | (speed > FASTEST)
        return jnp.where(
            wild | (modular_sensed(sensed).limit_excess > FURTHEST), WILD, Reason.FINISHED
        )

    def weights(self, settings: Any, generation: jax.Array) -> Mapping[str, jax.Array]:
        """The first term is a reward, all others are penalties.

        The weight of the overlap grows over the generations.
        """
        counts = {name: getattr(settings.weights, name) for name in self.terms}
        share = ramp(settings.apart, lambda now: now / settings.apart)(generation)
        counts["overlap"] = counts["overlap"] * share
        wanted = self.terms[0]
        return {n: jnp.asarray(c) if n == wanted else -jnp.asarray(c) for n, c in counts.items()}


class LocomotionTask(ModularTask):
    """Implementation of `Task`: get as far as possible.

    axes: number of world axes along which a way counts. dark: light of the empty statistics.
    """

    outcomes: ClassVar[tuple[str, ...]] = ("way", "seconds")
    axes: ClassVar[int] = 3
    dark: ClassVar[np.ndarray | None] = None

    def way(self, stats: LocomotionStats) -> jax.Array:
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
            "halfway": nowhere,
            "place": nowhere,
            "light": None if self.dark is None else jnp.asarray(self.dark),
            "gained": None if self.dark is None else jnp.zeros(()),
            "since": None if self.dark is None else none,
        }

    def update(
        self, stats: Any, sensed: Sensed, torque: jax.Array, params: jax.Array, goal: Any
    ) -> Any:
        """The place now, halfway, and when counting began."""
        half = (params + self.horizon) // 2
        return dataclasses.replace(
            stats,
            steps=stats.steps + 1,
            settled=jnp.where(stats.steps <= params, modular_sensed(sensed).com, stats.settled),
            halfway=jnp.where(stats.steps <= half, modular_sensed(sensed).com, stats.halfway),
            place=modular_sensed(sensed).com,
        )

    def curved(self, stats: LocomotionStats) -> jax.Array:
        """Share [] that a way loses by its curve: 1 less the cosine of the turn between its halves.

        On a circle, a path of twice this length ends this much nearer than twice as far.
        """
        first, second = (
            (end - begin)[: self.axes]
            for begin, end in ((stats.settled, stats.halfway), (stats.halfway, stats.place))
        )
        far = length(first) * length(second)
        return 1 - jnp.clip(jnp.sum(first * second) / jnp.maximum(far, NEAR), 0.0, 1.0)

    def speed(self, stats: LocomotionStats, settings: ModularConfig) -> jax.Array:
        """Speed [] in m/s over the time that counts, even if the episode ended early."""
        return self.way(stats) / jnp.maximum(self.horizon * self.step - settings.settle, self.step)

    def outcome(self, stats: LocomotionStats) -> Mapping[str, jax.Array]:
        """Distance in m from where counting began, and s until the end."""
        return {"way": self.way(stats), "seconds": stats.steps * self.step}


def length(vector: jax.Array) -> jax.Array:
    """Length [] of a vector."""
    return jnp.sqrt(jnp.sum(vector * vector))


def share_lost(much: jax.Array) -> jax.Array:
    """Share lost to a flaw of this size; one half at 1."""
    return 1 - 1 / (1 + much * much)
