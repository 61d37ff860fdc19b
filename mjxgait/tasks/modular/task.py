"""Base classes of the tasks for modular bodies: start at rest, any plausible motion counts.

Physically implausible motion ends the episode. Nothing counts until the body has settled. A way is
that of the centre of mass: bending moves the root, but not the whole body.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.rollout import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.tasks import base as protocol
from mjxgait.tasks.base import FINISHED
from mjxgait.tasks.modular.config import BlocksConfig
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.score import ramp
from mjxgait.tasks.starts import NEVER, Starts
from mjxgait.types import Sensed, pytree

WILD = 1
"""Reason for an early end: faster than anything alive, or bent past the range of a joint."""
FASTEST_HINGE, FASTEST, FURTHEST = 20.0, 5.0, 0.08
"""rad/s, m/s, rad past a hinge's range."""


@pytree
class Tally(protocol.Tally):
    """See `protocol.Tally`.

    settled, place: [3] m, centre of mass when counting began, and now.
    light: [3] m, its place. since: [] step from which the way counts. None without a light.
    """

    settled: jax.Array
    place: jax.Array
    light: jax.Array | None
    since: jax.Array | None


class BlocksTask(PlainTask):
    """See `Task`: the creature lies at rest, with bent joints in all trials but the first."""

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`. The root is at the origin; growing the body puts it on the ground."""
        count, joints = settings.starts, len(self.creature.joints.names)
        bent = settings.joint_noise * jax.random.uniform(key, (count, joints), minval=-1.0)
        bent = bent * (jnp.arange(count) > 0)[:, None]
        root = jnp.zeros((count, 7)).at[:, 3].set(1.0)
        still = jnp.zeros((count, self.creature.nv))
        return Starts(
            qpos=jnp.concatenate([root, bent], axis=1),
            qvel=still,
            friction=jnp.ones(count),
            push=still,
            push_step=jnp.full(count, NEVER),
            stiffness=jnp.ones((count, joints)),
            damping=jnp.ones((count, joints)),
        )

    def standards(self, settings: BlocksConfig) -> jax.Array:
        """See `Task`: the first step [] that counts."""
        return jnp.round(settings.settle / self.step).astype(jnp.int32)

    def ended(self, sensed: Sensed, aim: Any) -> jax.Array:
        """See `Task`."""
        speed = jnp.sqrt(jnp.sum(sensed.trunk_vel**2))
        wild = (jnp.max(jnp.abs(sensed.joint_vel)) > FASTEST_HINGE) | (speed > FASTEST)
        assert sensed.past is not None
        return jnp.where(wild | (sensed.past > FURTHEST), WILD, FINISHED)

    def weights(self, settings: Any, generation: jax.Array) -> Mapping[str, jax.Array]:
        """See `Task`: the first term is a reward, all others are penalties.

        The weight of the overlap grows over the generations.
        """
        counts = {name: getattr(settings.weights, name) for name in self.terms}
        share = ramp(settings.apart, lambda now: now / settings.apart)(generation)
        counts["overlap"] = counts["overlap"] * share
        wanted = self.terms[0]
        return {n: jnp.asarray(c) if n == wanted else -jnp.asarray(c) for n, c in counts.items()}


class GoingTask(BlocksTask):
    """See `Task`: get as far as possible.

    axes: number of world axes along which a way counts. dark: light of the empty statistics.
    """

    outcomes: ClassVar[tuple[str, ...]] = ("way", "seconds")
    axes: ClassVar[int] = 3
    dark: ClassVar[np.ndarray | None] = None

    def way(self, tally: Any) -> jax.Array:
        """Straight-line distance [] in m from where counting began."""
        return length((tally.place - tally.settled)[: self.axes])

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
        self, tally: Any, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Any:
        """See `Task`: the place now, and when counting began."""
        assert sensed.middle is not None
        return dataclasses.replace(
            tally,
            steps=tally.steps + 1,
            settled=jnp.where(tally.steps <= standards, sensed.middle, tally.settled),
            place=sensed.middle,
        )

    def speed(self, tally: Any, settings: BlocksConfig) -> jax.Array:
        """Speed [] in m/s over the time that counts, even if the episode ended early."""
        return self.way(tally) / jnp.maximum(self.horizon * self.step - settings.settle, self.step)

    def outcome(self, tally: Any) -> Mapping[str, jax.Array]:
        """See `Task`: m from where counting began, and s until the end."""
        return {"way": self.way(tally), "seconds": tally.steps * self.step}


def length(vector: jax.Array) -> jax.Array:
    """Length [] of a vector."""
    return jnp.sqrt(jnp.sum(vector * vector))


def lost(much: jax.Array) -> jax.Array:
    """Share lost to a flaw of this size; one half at 1."""
    return 1 - 1 / (1 + much * much)
