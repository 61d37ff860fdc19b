"""Swimming as a task: to get as far as possible from where one is after a while, any way."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from mjxgait.creature import Creature
from mjxgait.settings.config import RolloutConfig
from mjxgait.settings.swim import SwimConfig, SwimWeights
from mjxgait.tasks import protocol
from mjxgait.tasks.plain import PlainTask
from mjxgait.tasks.protocol import FINISHED
from mjxgait.tasks.trials import NEVER, Starts
from mjxgait.types import Sensed, pytree

WILD = 1
"""Why an episode ends early: faster than anything that swims, or bent further than it can be."""
FASTEST_HINGE, FASTEST, FURTHEST = 20.0, 5.0, 0.08
"""rad/s, m/s, rad past a hinge's range."""
LITTLE = 1e-6
"""kg·m/s; who exchanged less with the water exchanged nothing."""


@pytree
class Tally(protocol.Tally):
    """See `protocol.Tally`. settled, place: [3] m of the middle of all mass when counting began, and
    now: a trunk gets somewhere by bending, the whole does not.

    began: [3] kg·m/s, its momentum when counting began. given: [3] kg·m/s of the water since then;
    exchanged: [] the same without directions. lacking: [] kg·m/s, at most, that the water did not give.
    """

    settled: jax.Array
    place: jax.Array
    began: jax.Array
    given: jax.Array
    exchanged: jax.Array
    lacking: jax.Array


class Swim(PlainTask):
    """See `Task`: in water, from rest, without a floor. The way from there is as the crow flies."""

    Settings: ClassVar[type] = SwimConfig
    terms = tuple(field.name for field in dataclasses.fields(SwimWeights))
    outcomes = ("way", "seconds")

    def trials(self, key: jax.Array, creature: Creature, settings: RolloutConfig) -> Starts:
        """See `Task`: at rest; all but the first with bent joints."""
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

    def standards(self, settings: SwimConfig) -> jax.Array:
        """See `Task`: the step [] from which on the way counts."""
        return jnp.round(settings.settle / self.step).astype(jnp.int32)

    def init(self) -> Tally:
        """See `Task`."""
        none, nothing, nowhere = jnp.zeros((), jnp.int32), jnp.zeros(()), jnp.zeros(3)
        return Tally(
            none,
            none,
            nothing,
            nowhere,
            nowhere,
            nowhere,
            nowhere,
            exchanged=nothing,
            lacking=nothing,
        )

    def ended(self, sensed: Sensed, aim: Any) -> jax.Array:
        """See `Task`: what nothing alive does is no swimming."""
        speed = jnp.sqrt(jnp.sum(sensed.trunk_vel**2))
        wild = (jnp.max(jnp.abs(sensed.joint_vel)) > FASTEST_HINGE) | (speed > FASTEST)
        assert sensed.past is not None
        return jnp.where(wild | (sensed.past > FURTHEST), WILD, FINISHED)

    def update(
        self, tally: Tally, sensed: Sensed, torque: jax.Array, standards: Any, aim: Any
    ) -> Tally:
        """See `Task`."""
        assert sensed.middle is not None
        assert sensed.momentum is not None
        assert sensed.washed is not None
        begins, momentum, push = (
            tally.steps <= standards,
            sensed.momentum,
            sensed.washed * self.step,
        )
        began = jnp.where(begins, momentum, tally.began)
        given = jnp.where(begins, 0.0, tally.given)
        lacking = jnp.where(
            begins, 0.0, jnp.maximum(tally.lacking, _length(momentum - began - given))
        )
        return dataclasses.replace(
            tally,
            steps=tally.steps + 1,
            settled=jnp.where(begins, sensed.middle, tally.settled),
            place=sensed.middle,
            began=began,
            given=given + push,
            exchanged=jnp.where(begins, 0.0, tally.exchanged) + _length(push),
            lacking=lacking,
        )

    def judge(self, tally: Tally, settings: SwimConfig) -> Mapping[str, jax.Array]:
        """See `Task`: m/s over the time that counts, whether it lived to its end or not; what of it
        is lost by blocks that stand in each other; and of the rest by momentum from elsewhere.
        """
        speed = _way(tally) / jnp.maximum(self.horizon * self.step - settings.settle, self.step)
        inside = _lost(tally.overlap / settings.overlap)
        share = tally.lacking / jnp.maximum(tally.exchanged, LITTLE)
        elsewhere = (1 - inside) * _lost(share / settings.elsewhere)
        return {"speed": speed, "overlap": speed * inside, "elsewhere": speed * elsewhere}

    def outcome(self, tally: Tally) -> Mapping[str, jax.Array]:
        """See `Task`: m from where counting began, and s until the end."""
        return {"way": _way(tally), "seconds": tally.steps * self.step}

    def weights(self, settings: SwimConfig, generation: jax.Array) -> Mapping[str, jax.Array]:
        """See `Task`."""
        counts, share = settings.weights, jnp.minimum(generation / settings.apart, 1.0)
        return {
            "speed": jnp.asarray(counts.speed),
            "overlap": -counts.overlap * share,
            "elsewhere": -jnp.asarray(counts.elsewhere),
        }


def _way(tally: Tally) -> jax.Array:
    return _length(tally.place - tally.settled)


def _length(vector: jax.Array) -> jax.Array:
    return jnp.sqrt(jnp.sum(vector * vector))


def _lost(much: jax.Array) -> jax.Array:
    """The share that is lost by something, half of it at 1."""
    return 1 - 1 / (1 + much * much)
