"""A reward written for a trot, as MuJoCo Playground's: what a person adds so that PPO learns fast.

Speed along the start's forward axis and feet that follow a trot's rise and fall earn up to 1 per
second each. All that a walk should not do costs. On six feet the trot is a tripod, on two a walk.
"""

import dataclasses
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import foot_geoms, sense
from mjxgait.creature import Creature
from mjxgait.environments.functional import State
from mjxgait.types import Sensed

SENSED = (
    "forward_vel",
    "up_vel",
    "heading",
    "aside",
    "pitch",
    "roll",
    "pitch_rate",
    "roll_rate",
    "joint_pos",
    "joint_vel",
    "foot_height",
    "contact",
)


@dataclasses.dataclass(frozen=True, eq=False)
class GaitReward:
    """Reward of one action. creature: its body. period: s, of a stride. held: s, of an action."""

    creature: Creature
    period: float
    held: float
    speed: float = 0.9  # body lengths per second
    lift: float = 0.14  # hip heights

    def of(self, before: State, after: State) -> jax.Array:
        """Return the reward [] between the states before and after an action."""
        frame, time = self.creature.frame, after.data.progress.stats.steps
        sensed = after.data.sensed
        now = sense(self.creature, sensed, jnp.zeros(()), SENSED)
        seconds = time * float(self.creature.model.opt.timestep)
        wanted = self.speed * frame.body_length
        moving = jnp.exp(-jnp.square((now["forward_vel"] - wanted) / (0.4 * wanted)))
        off = (now["foot_height"] - self._rise(seconds)) / (0.4 * self.lift * frame.hip_height)
        stepping = jnp.exp(-jnp.mean(jnp.square(off)))
        stood = sense(self.creature, before.data.sensed, jnp.zeros(()), ("contact",))["contact"]
        slid = self._feet(sensed) - self._feet(before.data.sensed)
        slip = jnp.sum(stood * now["contact"] * jnp.linalg.norm(slid, axis=1)) / self.held
        cost = (
            0.4 * jnp.square(now["heading"])
            + 0.2 * jnp.square(now["aside"] / frame.body_length)
            + 0.5 * jnp.square(now["up_vel"])
            + 2.0 * (jnp.square(now["pitch"]) + jnp.square(now["roll"]))
            + 0.02 * (jnp.square(now["pitch_rate"]) + jnp.square(now["roll_rate"]))
            + 0.1 * jnp.sum(jnp.square(now["joint_pos"] - self.creature.joints.stand))
            + 2e-4 * jnp.sum(jnp.square(now["joint_vel"]))
            + 5e-4 * jnp.sum(jnp.square(now["joint_vel"] - before.data.sensed.joint_vel))
            + 0.3 * slip
        )
        fell = after.done * (1 - after.info["time_out"])
        earned = moving + stepping - jnp.minimum(jnp.nan_to_num(cost, nan=2.0), 2.0)
        return jnp.nan_to_num(self.held * earned) - 0.5 * fell

    def _rise(self, seconds: jax.Array) -> jax.Array:
        """Return the wanted height [F] of the feet in m: half of the time on the floor."""
        turn = 2 * jnp.pi * (seconds / self.period + self._phases)
        return self.lift * self.creature.frame.hip_height * jnp.maximum(jnp.sin(turn), 0.0)

    @cached_property
    def _phases(self) -> np.ndarray:
        """Phase [F] of each foot: that of the next foot, ahead or across, is half a cycle off."""
        return 0.5 * np.array([(rank + left) % 2 for rank, left in self.creature.feet.stations])

    def _feet(self, sensed: Sensed) -> jax.Array:
        """Return the places [F, 2] of the feet in m."""
        geoms = foot_geoms(self.creature)
        return jnp.stack([jnp.mean(sensed.geom_pos[one], axis=0)[:2] for one in geoms])
