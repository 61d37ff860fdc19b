"""Soft constraints of MuJoCo for contacts and limits, independent of the tree.

Formulas: MuJoCo documentation, "Computation", sections "Constraint model" and "Contact", and MJX's
constraint.py. Values of contacts are [C, L], of limits [M, L]; a contact's three directions are
those of `frames`.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.physics.lane_major.frames import Directions
from mjxgait.physics.lane_major.lanes import Pin, Scalar
from mjxgait.physics.lane_major.parameters import Softness
from mjxgait.types import Number

SMALLEST_FRICTION = 1e-5
"""mjMINMU, the lower bound of friction coefficients in MuJoCo's engine."""


@dataclasses.dataclass(frozen=True)
class Springs:
    """Springs of n constraints.

    softness: [n, 1 or L]. powers: of the impedances, [n] or one for all.
    inverse: [n, L] inverse mass that they hold.
    """

    softness: Softness
    powers: Sequence[float]
    inverse: Number


def contact_terms(
    springs: Springs,
    distance: jax.Array,
    friction: Number,
    velocity: Directions,
    pin: Pin,
    impratio: Scalar = 1.0,
) -> tuple[jax.Array, Directions, jax.Array]:
    """Friction, reference and weight of contacts, see `Constraints`; velocity: of their points."""
    mu = jnp.maximum(friction, SMALLEST_FRICTION)
    stiffness, damping = springs.softness.stiffness, springs.softness.damping
    impedance, depth = soften(springs.softness, springs.powers, distance)
    # Regulariser of all edges (MJX `_efc_contact_pyramidal`): inverse mass along one, by friction.
    inverse = springs.inverse * (1 + mu * mu) * 2 * mu * mu / impratio
    normal, first, second = velocity
    reference = (
        -damping * normal - stiffness * impedance * depth,
        -damping * first,
        -damping * second,
    )
    return pin(mu), pin(reference), pin(_weight(impedance, depth, inverse))


def limit_terms(
    springs: Springs, over_low: Number, under_high: Number, velocity: jax.Array, pin: Pin
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Sign, reference and weight of limits, see `Constraints`, from the ways to both ends."""
    sign = jnp.where(over_low < under_high, 1.0, -1.0)
    stiffness, damping = springs.softness.stiffness, springs.softness.damping
    nearer = jnp.minimum(over_low, under_high)
    impedance, depth = soften(springs.softness, springs.powers, nearer)
    reference = -damping * sign * velocity - stiffness * impedance * depth
    return pin(sign), pin(reference), pin(_weight(impedance, depth, springs.inverse))


def _weight(impedance: Any, depth: jax.Array, inverse: Number) -> jax.Array:
    return jnp.where(
        depth < 0, impedance / jnp.maximum(inverse * (1 - impedance), mujoco.mjMINVAL), 0.0
    )


def soften(
    softness: Softness, powers: Sequence[float], distance: jax.Array
) -> tuple[Any, jax.Array]:
    """Impedance, and distance less margin (computation docs, "Impedance")."""
    low, high, width, mid = (softness.impedance[:, n] for n in range(4))
    power = np.array(powers, distance.dtype)[:, None]
    depth = distance - softness.margin
    x = jnp.minimum(jnp.abs(depth) / width, 1.0)
    raised = _power(power)
    y = jnp.where(
        x < mid, raised(x) / raised(mid) * mid, 1 - raised(1 - x) / raised(1 - mid) * (1 - mid)
    )
    return low + y * (high - low), depth


def _power(power: np.ndarray) -> Callable[..., jax.Array]:
    """Power function; MuJoCo's default 2 needs no transcendental functions."""
    return (lambda x: x * x) if np.all(power == 2) else (lambda x: jnp.power(x, power))
