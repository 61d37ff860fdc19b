"""Initial conditions of the trials, shared by all individuals: first nominal, others perturbed."""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.config.schema import RolloutConfig
from mjxgait.creature import Creature
from mjxgait.creature.creature import horizontal_freedoms, start_place
from mjxgait.creature.ground.spec import Place, parse_ground
from mjxgait.creature.ground.surface import (
    DRAWS,
    Ground,
    lay_ground,
    lay_uneven,
    named_draws,
)
from mjxgait.types import pytree

NEVER = -1


@pytree
class Starts:
    """Initial states and disturbances.

    qpos: [R, nq]. qvel: [R, nv]. friction: [R] factor on the floor's friction.
    push: [R, nv] added to qvel at step push_step [R] (never when it is `NEVER`).
    stiffness, damping: [R, J] factors on the joints' kp and kd.
    mass_scale: [R, nbody - 1] factors on the parts' masses and inertias; None if all are 1.
    parameters: leaves [R, ...], those of each trial's own body (from mass_scale, evolved sizes or
      growth), as the plant reads them; None where the plant's own apply.
    ground: leaves [R, ...], one per trial, a `Ground`, or the `Medium` of modular bodies; None if
      all are flat.
    goal: leaves [R, ...], what the task adds to a trial, as its `Task.goal` reads it; None if it
      adds nothing.
    delay: [R] control steps by which torques are late; None if they never are.
    """

    qpos: jax.Array
    qvel: jax.Array
    friction: jax.Array
    push: jax.Array
    push_step: jax.Array
    stiffness: jax.Array
    damping: jax.Array
    ground: Any = None
    mass_scale: jax.Array | None = None
    parameters: object = None
    goal: Any = None
    delay: jax.Array | None = None


@pytree
class _Spread:
    """Scales of the drawn numbers.

    Those of config and creature are inputs, so that all of one shape share a program.

    standing: [nq]. qpos, dofs: [J] addresses of the joints. level: [2, nv] horizontal motion.
    angle: rad. rate: rad/s. friction: [2]. speed: m/s. moment: [2] steps.
    """

    standing: np.ndarray
    qpos: np.ndarray
    dofs: np.ndarray
    level: np.ndarray
    angle: float
    rate: float
    friction: tuple[float, float]
    speed: float
    moment: tuple[int, int]


def draw_starts(key: jax.Array, creature: Creature, config: RolloutConfig) -> Starts:
    """Draw R initial conditions; the same key gives the same ones.

    Perturbations are uniform within the half widths of the config.
    """
    starts = _drawn(key, _spread(creature, config), config.starts, creature.model.nbody - 1)
    # Outside the program, which may round a product and a sum once instead of twice.
    return dataclasses.replace(
        starts,
        stiffness=_factors(config.gains, starts.stiffness),
        damping=_factors(config.gains, starts.damping),
        mass_scale=_mass_scale(starts.mass_scale, creature, config),
        ground=draw_grounds(jax.random.fold_in(key, 2), creature, config),
        delay=_delay(jax.random.fold_in(key, 6), config),
    )


def _spread(creature: Creature, config: RolloutConfig) -> _Spread:
    steps = round(config.seconds / creature.model.opt.timestep)
    return _Spread(
        standing=np.asarray(creature.stand_qpos, np.float32),
        qpos=creature.joints.qpos_adr,
        dofs=creature.joints.dof_adr,
        level=horizontal_freedoms(creature),
        angle=config.joint_noise,
        rate=config.velocity_noise,
        friction=config.friction,
        speed=config.push * creature.unit_speed,
        moment=(steps // 4, max(3 * steps // 4, steps // 4 + 1)),
    )


@partial(jax.jit, static_argnums=(2, 3))
def _drawn(key: jax.Array, by: _Spread, count: int, parts: int) -> Starts:
    """Return initial conditions, their factors still as drawn, in [-1, 1)."""
    key_pos, key_vel, key_friction, key_direction, key_moment = jax.random.split(key, 5)
    key_stiffness, key_damping = jax.random.split(jax.random.fold_in(key, 1))
    perturbed = (jnp.arange(count) > 0)[:, None]

    def spread(key: jax.Array, columns: int = len(by.qpos)) -> jax.Array:
        return jax.random.uniform(key, (count, columns), minval=-1.0)

    low, high = by.friction
    friction = jax.random.uniform(key_friction, (count,), minval=low, maxval=high)
    angle = jax.random.uniform(key_direction, (count,), maxval=2 * jnp.pi)
    direction = perturbed * jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=1)
    moment = jax.random.randint(key_moment, (count,), *by.moment)
    standing = jnp.tile(by.standing, (count, 1))
    still = jnp.zeros((count, by.level.shape[1]))
    return Starts(
        qpos=standing.at[:, by.qpos].add(perturbed * by.angle * spread(key_pos)),
        qvel=still.at[:, by.dofs].set(perturbed * by.rate * spread(key_vel)),
        friction=jnp.where(perturbed[:, 0], friction, 1.0),
        push=by.speed * direction @ by.level,
        push_step=jnp.where(perturbed[:, 0], moment, NEVER),
        stiffness=spread(key_stiffness),
        damping=spread(key_damping),
        mass_scale=spread(jax.random.fold_in(key, 3), parts),
    )


def half_widths(size: float, count: int) -> jax.Array:
    """Return the half width [R, 1] of a perturbation in each trial: 0 in the first."""
    sizes = np.full((count, 1), size, np.float32)
    sizes[0] = 0.0
    return jnp.asarray(sizes)


def _factors(size: float, spread: jax.Array) -> jax.Array:
    """Return factors [R, n] from numbers in [-1, 1)."""
    return 1 + half_widths(size, len(spread)) * spread


def milder(starts: Starts, share: jax.Array) -> Starts:
    """Scale the disturbances of the initial conditions by this share [].

    Bodies, ground and the goals of the trials stay.
    """

    def part(leaf: jax.Array, usual: jax.Array | float) -> jax.Array:
        return usual + share * (leaf - usual)

    late = starts.delay
    return dataclasses.replace(
        starts,
        qpos=part(starts.qpos, starts.qpos[:1]),
        qvel=share * starts.qvel,
        friction=part(starts.friction, 1.0),
        push=share * starts.push,
        stiffness=part(starts.stiffness, 1.0),
        damping=part(starts.damping, 1.0),
        delay=late if late is None else jnp.floor(share * late).astype(late.dtype),
    )


def _delay(key: jax.Array, config: RolloutConfig) -> jax.Array | None:
    if not config.latency:
        return None
    return jax.random.randint(key, (config.starts,), 0, config.latency + 1).at[0].set(0)


def _mass_scale(
    spread: jax.Array | None, creature: Creature, config: RolloutConfig
) -> jax.Array | None:
    if spread is None or not config.masses:
        return None
    # Bodies welded to a part share its mass scale.
    carrier = np.maximum(creature.model.body_weldid[1:] - 1, 0)
    return _factors(config.masses, spread[:, carrier])


def draw_grounds(key: jax.Array, creature: Creature, config: RolloutConfig) -> Ground | None:
    """Draw the ground of each trial: leaves [R, ...]; None if all are flat.

    The nominal start has the ground that the config names. The others have variants of its kind, or
    uneven ground of their own.
    """
    spec, place = parse_ground(config.ground), start_place(creature)
    if spec.flat and not config.uneven:
        return None
    draws = jax.random.uniform(key, (config.starts, DRAWS, 2)).at[0].set(named_draws(spec.seed))
    if spec.flat:
        return _stacked(_uneven(jax.random.fold_in(key, 1), place, config, draws))
    return _stacked([lay_ground(spec, place, each) for each in draws])


def _stacked(grounds: list[Ground | None]) -> Ground:
    stacked: Ground = jax.tree.map(lambda *leaves: jnp.stack(leaves), *grounds)
    return stacked


def _uneven(
    key: jax.Array, place: Place, config: RolloutConfig, draws: jax.Array
) -> list[Ground | None]:
    """Lay level ground for the nominal start and sloping, rough ground for the others.

    The slopes spread evenly to all sides, from a random first one. They are uniform over the disc
    of allowed slopes, so more of them are steep than not.
    """
    others = max(config.starts - 1, 1)
    side = (jnp.arange(config.starts) + jax.random.uniform(key)) / others
    steep = jnp.sqrt(jax.random.uniform(jax.random.fold_in(key, 1), (config.starts,)))
    rise, turn = np.tan(np.radians(config.slope)) * steep, 2 * jnp.pi * side
    slopes = rise[:, None] * jnp.stack([jnp.cos(turn), jnp.sin(turn)], axis=1)
    return [
        lay_uneven(place, slopes[i] if i else (0.0, 0.0), config.rough if i else 0.0, draws[i])
        for i in range(config.starts)
    ]
