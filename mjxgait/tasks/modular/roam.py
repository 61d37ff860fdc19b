"""Roam task for modular bodies: get as far as possible on land; users call it walking."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.tasks.modular.base import (
    LITTLE,
    SHARPNESS,
    LocomotionStats,
    LocomotionTask,
    modular_sensed,
    share_lost,
)
from mjxgait.tasks.modular.config import RoamConfig, RoamWeights
from mjxgait.types import Sensed, pytree


@pytree
class RoamStats(LocomotionStats):
    """Extension of `LocomotionStats`.

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


class Roam(LocomotionTask):
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
            overlap=jnp.where(
                begins, stats.overlap, jnp.maximum(stats.overlap, modular_sensed(sensed).depth)
            ),
            upwards=upwards,
            upright=jnp.where(begins, 1.0, jnp.minimum(stats.upright, upright)),
            joint_vel=sensed.joint_vel,
            moved=jnp.where(begins, 0.0, stats.moved + jnp.sum(sensed.joint_vel**2)),
            jerked=jnp.where(begins, 0.0, stats.jerked + jnp.sum(changes**2)),
        )

    def evaluate(self, stats: RoamStats, settings: RoamConfig) -> Mapping[str, jax.Array]:
        """The speed; its loss by overlap, then of each rest by tipping over, vibration, and curves.

        Blocks overlap each other or the ground.
        """
        speed = self.speed(stats, settings)
        earned = jnp.maximum(speed, 0.0)
        inside = share_lost(stats.overlap / settings.overlap)
        tilt = jnp.degrees(jnp.arccos(jnp.clip(stats.upright, -1.0, 1.0)))
        tipped = (1 - inside) * share_lost(tilt / settings.tilt)
        vibrates = (1 - inside - tipped) * shaken(stats, settings.vibration)
        return {
            "speed": speed,
            "overlap": earned * inside,
            "balance": earned * tipped,
            "vibration": earned * vibrates,
            "curve": earned * (1 - inside - tipped - vibrates) * self.curved(stats),
        }


def shaken(stats: RoamStats, half: jax.Array | float) -> jax.Array:
    """Share [] lost by joints that vibrate; half: vibration at which it is one half."""
    vibration = jnp.sqrt(stats.jerked / jnp.maximum(stats.moved, LITTLE))
    return share_lost((vibration / half) ** SHARPNESS)
