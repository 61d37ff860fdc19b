"""Stable PD control, and the drive from a controller's command to joint torques.

Stable PD (Tan, Liu & Turk 2011, "Stable proportional-derivative controllers") or plain PD tracks a
pose; a torque is only clamped. Stable PD is two elementwise parts, for one creature or a batch. The
solve with `M + h diag(kd)` between them needs the mass matrix; `Drive.torque` joins all three.
"""

import dataclasses
from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from mjxgait.config.traced import chosen
from mjxgait.controllers.base import Command
from mjxgait.controllers.config import DriveConfig
from mjxgait.creature.body import Body
from mjxgait.types import BodyState, Plant, Sensed, pytree

StepData = TypeVar("StepData")
Function = TypeVar("Function", bound=Callable[..., object])


def pd_force(
    pos: jax.Array, vel: jax.Array, target: jax.Array, kp: ArrayLike, kd: ArrayLike, step: ArrayLike
) -> jax.Array:
    """Return the PD force at the end of the step: `-kp (q + h v - target) - kd v` in N·m.

    All [J]; step in s, 0 gives plain PD.
    """
    return -jnp.asarray(kp) * (pos + step * vel - target) - jnp.asarray(kd) * vel


def limited_torque(
    force: jax.Array, acceleration: jax.Array, brake: ArrayLike, limit: ArrayLike
) -> jax.Array:
    """Return the torque [J]: `force - brake acc` with `brake = h kd`, clamped to the limit.

    Clamping comes last; otherwise the damping would be that of a stronger joint.
    """
    return jnp.clip(
        force - jnp.asarray(brake) * acceleration, -jnp.asarray(limit), jnp.asarray(limit)
    )


@pytree
class Rules:
    """Drive parameters of an episode.

    stable: [] stable PD, else plain PD. constraint_forces: [] whether stable PD includes them.
    stiffness, damping: [J] factors on the creature's kp and kd.
    """

    stable: jax.Array
    constraint_forces: jax.Array
    stiffness: jax.Array
    damping: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class Drive:
    """Joint motors of one creature.

    step: s, time step of the simulation; a command may be held for several.
    """

    creature: Body
    step: float
    command: Command

    def rules(self, settings: DriveConfig, stiffness: jax.Array, damping: jax.Array) -> Rules:
        """Return an episode's rules from settings, plain or traced, and gain factors [J]."""
        return Rules(
            stable=chosen(settings.law, "spd"),
            constraint_forces=jnp.asarray(settings.constraint_forces),
            stiffness=settings.stiffness * stiffness,
            damping=settings.damping * damping,
        )

    def torque(
        self,
        plant: Plant[StepData],
        rules: Rules,
        body: BodyState,
        sensed: Sensed,
        step_data: StepData,
        command: jax.Array,
    ) -> jax.Array:
        """Return joint torques in N·m, [J] per lane, as are rules, states and command."""
        limit = self.creature.gains.torque_limit.astype(np.float32)
        if self.command == "torque":
            return per_lane(plant, lambda wanted: jnp.clip(wanted, -limit, limit))(command)
        force, braked, damping = per_lane(plant, self._pull)(
            rules, sensed.joint_pos, sensed.joint_vel, command
        )
        pushed = jnp.where(rules.constraint_forces, 1.0, 0.0)
        total = per_lane(plant, lambda f, c, on, bias: self.lift(f) + on * c - bias)(
            force, body.constraint_force, pushed, sensed.bias
        )
        acceleration = plant.solve_damped(step_data, damping, total)
        adr = self.creature.joints.dof_adr
        return per_lane(plant, lambda f, a, b: limited_torque(f, a[adr], b, limit))(
            force, acceleration, braked
        )

    def _pull(
        self, rules: Rules, pos: jax.Array, vel: jax.Array, goal: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Return the PD force [J], the brake `h kd` [J], and damping [nv] for the implicit solve.

        Plain PD is stable PD with `h` = 0 in the force and the brake.
        """
        kp, kd = (
            self.creature.gains.kp.astype(np.float32) * rules.stiffness,
            self.creature.gains.kd.astype(np.float32) * rules.damping,
        )
        ahead = jnp.where(rules.stable, self.step, 0.0)
        return pd_force(pos, vel, goal, kp, kd, ahead), ahead * kd, self.lift(self.step * kd)

    def lift(self, joints: ArrayLike) -> jax.Array:
        """Return joint values [J] at their degrees of freedom [nv], zero elsewhere."""
        adr, nv = self.creature.joints.dof_adr, self.creature.nv
        if np.array_equal(adr, np.arange(adr[0], adr[0] + len(adr))):
            return jnp.pad(jnp.asarray(joints), (adr[0], nv - adr[-1] - 1))
        return jnp.zeros(nv, jnp.float32).at[adr].set(joints)


def per_lane(plant: Plant, function: Function) -> Function:
    """Map a function of one creature over a plant's lanes."""
    return jax.vmap(function, in_axes=plant.lane_axis, out_axes=plant.lane_axis)
