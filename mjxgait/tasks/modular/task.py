"""What all that bodies of blocks are to do has in common: from rest, any way, as something alive might.

What they do counts from a while after the start on. A way is that of the middle of all mass: a root
gets somewhere by bending, the whole does not.
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
"""Why an episode ends early: faster than anything alive, or bent further than it can be."""
FASTEST_HINGE, FASTEST, FURTHEST = 20.0, 5.0, 0.08
"""rad/s, m/s, rad past a hinge's range."""


@pytree
class Tally(protocol.Tally):
    """See `protocol.Tally`. settled, place: [3] m of the middle of all mass when counting began, and
    now. light: [3] m where it is, and since: [] the step from which on it counts; None where there is
    none.
    """

    settled: jax.Array
    place: jax.Array
    light: jax.Array | None
    since: jax.Array | None


class BlocksTask(PlainTask):
    """See `Task`: the creature lies at rest, all but the first with bent joints."""

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`. A root at the origin; whoever grows the body puts it on the ground."""
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
        """See `Task`: the step [] from which on it counts."""
        return jnp.round(settings.settle / self.step).astype(jnp.int32)

    def ended(self, sensed: Sensed, aim: Any) -> jax.Array:
        """See `Task`."""
        speed = jnp.sqrt(jnp.sum(sensed.trunk_vel**2))
        wild = (jnp.max(jnp.abs(sensed.joint_vel)) > FASTEST_HINGE) | (speed > FASTEST)
        assert sensed.past is not None
        return jnp.where(wild | (sensed.past > FURTHEST), WILD, FINISHED)

    def weights(self, settings: Any, generation: jax.Array) -> Mapping[str, jax.Array]:
        """See `Task`: the first term is what is wanted, all others are penalties; what overlap costs
        counts more and more.
        """
        counts = {name: getattr(settings.weights, name) for name in self.terms}
        share = ramp(settings.apart, lambda now: now / settings.apart)(generation)
        counts["overlap"] = counts["overlap"] * share
        wanted = self.terms[0]
        return {n: jnp.asarray(c) if n == wanted else -jnp.asarray(c) for n, c in counts.items()}


class GoingTask(BlocksTask):
    """See `Task`: to get as far as possible.

    axes: along how many of the world's a way counts. dark: the light of an empty tally.
    """

    outcomes: ClassVar[tuple[str, ...]] = ("way", "seconds")
    axes: ClassVar[int] = 3
    dark: ClassVar[np.ndarray | None] = None

    def way(self, tally: Any) -> jax.Array:
        """[] m from where counting began, as the crow flies."""
        return length((tally.place - tally.settled)[: self.axes])

    def begun(self) -> dict[str, Any]:
        """What the empty tallies of all of them have."""
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
        """See `Task`: where it is, and where it was when counting began."""
        assert sensed.middle is not None
        return dataclasses.replace(
            tally,
            steps=tally.steps + 1,
            settled=jnp.where(tally.steps <= standards, sensed.middle, tally.settled),
            place=sensed.middle,
        )

    def speed(self, tally: Any, settings: BlocksConfig) -> jax.Array:
        """[] m/s over the time that counts, whether it lived to its end or not."""
        return self.way(tally) / jnp.maximum(self.horizon * self.step - settings.settle, self.step)

    def outcome(self, tally: Any) -> Mapping[str, jax.Array]:
        """See `Task`: m from where counting began, and s until the end."""
        return {"way": self.way(tally), "seconds": tally.steps * self.step}


def length(vector: jax.Array) -> jax.Array:
    """[] of a vector."""
    return jnp.sqrt(jnp.sum(vector * vector))


def lost(much: jax.Array) -> jax.Array:
    """The share that is lost by something, half of it at 1."""
    return 1 - 1 / (1 + much * much)
