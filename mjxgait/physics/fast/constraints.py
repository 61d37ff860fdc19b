"""Contacts with the floor and joint limits as MuJoCo's soft constraints.

A contact of MuJoCo's pyramidal cone has four edges, normal plus or minus friction times each tangent. Here it is kept in its three
directions (normal, first, second tangent), of which the edges are combinations: a third of the Jacobian, and the friction enters late.
All contacts' values lie side by side in arrays [C, L], the limits' in [M, L]. Formulas: MuJoCo documentation, "Computation", sections
"Constraint model" and "Contact", and MJX's constraint.py.
"""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.physics.fast.kinematics import Pose
from mjxgait.physics.fast.lanes import Pin, add, turn
from mjxgait.physics.fast.structure import Contact, Softness, Structure

SMALLEST_FRICTION = 1e-5
"""mjMINMU, under which MuJoCo's engine lets no friction coefficient fall."""


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Touch:
    """Geometry of all contacts.

    distance: [C, L] m. rows: per contact its Jacobian along normal and tangents, [n, L] over its chain of degrees of freedom.
    """

    distance: jax.Array
    rows: tuple[tuple[jax.Array, jax.Array, jax.Array], ...]


@dataclasses.dataclass(frozen=True)
class Constraints:
    """All that the solver needs to know.

    structure, rows: chains and Jacobians. friction: [C, L]. reference: three [C, L], what the accelerations along normal and tangents are
    compared with. weight: [C, L] inverse regulariser of an edge, zero where there is no contact. The same of limits: sign, limit_reference,
    limit_weight [M, L].
    """

    structure: Structure
    rows: tuple[tuple[jax.Array, jax.Array, jax.Array], ...]
    friction: jax.Array
    reference: tuple[jax.Array, ...]
    weight: jax.Array
    sign: jax.Array
    limit_reference: jax.Array
    limit_weight: jax.Array

    @property
    def chains(self) -> list[tuple[int, ...]]:
        """Per contact the degrees of freedom that move it."""
        return [self.structure.body_chain[c.body] for c in self.structure.contacts]

    def along(self, vector: Sequence[jax.Array], pin: Pin) -> tuple[jax.Array, ...]:
        """J x of contacts along normal and tangents, three [C, L]."""
        return along(self.chains, self.rows, vector, pin)

    def limited(self, vector: Sequence[jax.Array]) -> jax.Array:
        """J x of limits, [M, L]."""
        return self.sign * jnp.stack([vector[limit.dof] for limit in self.structure.limits])


def along(
    chains: Sequence[tuple[int, ...]],
    rows: Sequence[Sequence[jax.Array]],
    vector: Sequence[jax.Array],
    pin: Pin,
) -> tuple[jax.Array, ...]:
    """Contact Jacobian times a vector over the degrees of freedom: normal and tangents, three [C, L]."""

    def product(row: jax.Array, chain: tuple[int, ...]) -> jax.Array:
        terms = [row[n] * vector[k] for n, k in enumerate(chain)]
        return sum(terms[1:], terms[0])

    return tuple(
        pin(jnp.stack([product(row[d], chain) for row, chain in zip(rows, chains, strict=True)]))
        for d in range(3)
    )


def touch(
    structure: Structure, poses: Sequence[Pose], paths: dict[int, jax.Array], pin: Pin
) -> Touch | None:
    """Distances and Jacobians of all contacts."""
    if not structure.contacts:
        return None
    found = [
        _touch_one(structure, contact, poses[contact.body], paths, pin)
        for contact in structure.contacts
    ]
    return Touch(jnp.stack([distance for distance, _ in found]), tuple(rows for _, rows in found))


def _touch_one(
    structure: Structure, contact: Contact, pose: Pose, paths: dict[int, jax.Array], pin: Pin
) -> tuple[jax.Array, tuple[jax.Array, jax.Array, jax.Array]]:
    center = pin(pose.point(contact.center))
    distance = pin(add(pose.origin, center)[2] - contact.radius)
    # MuJoCo puts the contact point half way between the two surfaces.
    height = pin(center[2] - contact.radius - 0.5 * distance)
    chain = structure.body_chain[contact.body]
    rows = _point_velocity(paths[chain[-1]][: len(chain)], center[0], center[1], height)
    if contact.axis is not None:
        rows = _aligned(rows, pin(turn(pose.rot, contact.axis)), pin)
    return distance, pin((rows[2], rows[0], rows[1]))


def _point_velocity(
    path: jax.Array, x: jax.Array, y: jax.Array, z: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """World velocity at a point per unit velocity of each degree of freedom, three [n, L]."""
    wx, wy, wz, vx, vy, vz = (path[:, c] for c in range(6))
    return vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x


def _aligned(
    rows: tuple[jax.Array, jax.Array, jax.Array], axis: jax.Array, pin: Pin
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Tangents along and across the capsule's axis as seen from above; along the world's y where it stands upright."""
    length = jnp.sqrt(axis[0] * axis[0] + axis[1] * axis[1])
    upright = length < 0.5
    safe = jnp.where(upright, 1.0, length)
    x, y = jnp.where(upright, 0.0, axis[0] / safe), jnp.where(upright, 1.0, axis[1] / safe)
    x, y = pin((x, y))
    return rows[0] * x + rows[1] * y, rows[1] * x - rows[0] * y, rows[2]


def make_constraints(
    structure: Structure,
    touch: Touch | None,
    friction: jax.Array,
    qpos: jax.Array,
    qvel: jax.Array,
    pin: Pin,
) -> Constraints | None:
    """The constraints of the current state, None for a model without any."""
    if not structure.contacts and not structure.limits:
        return None
    empty = jnp.zeros((0, friction.shape[-1]), friction.dtype)
    mu, reference, weight = (
        (empty, (empty,) * 3, empty)
        if touch is None
        else _contact_terms(structure, touch, friction, qvel, pin)
    )
    limit = _limit_terms(structure, qpos, qvel, pin) if structure.limits else (empty, empty, empty)
    return Constraints(
        structure, () if touch is None else touch.rows, mu, reference, weight, *limit
    )


def _contact_terms(
    structure: Structure, touch: Touch, friction: jax.Array, qvel: jax.Array, pin: Pin
) -> tuple[jax.Array, tuple[jax.Array, ...], jax.Array]:
    contacts = structure.contacts
    column = partial(_column, dtype=friction.dtype)
    mu = jnp.maximum(column([c.friction for c in contacts]) * friction, SMALLEST_FRICTION)
    stiffness, damping, impedance, depth = _soften([c.softness for c in contacts], touch.distance)
    # Regulariser of all edges (MJX `_efc_contact_pyramidal`): inverse mass along an edge, scaled by friction.
    inverse_mass = (
        column([c.weight for c in contacts]) * (1 + mu * mu) * 2 * mu * mu / structure.impratio
    )
    weight = jnp.where(
        depth < 0, impedance / jnp.maximum(inverse_mass * (1 - impedance), mujoco.mjMINVAL), 0.0
    )
    chains = [structure.body_chain[c.body] for c in contacts]
    normal, first, second = along(chains, touch.rows, list(qvel), pin)
    reference = (
        -damping * normal - stiffness * impedance * depth,
        -damping * first,
        -damping * second,
    )
    return pin(mu), pin(reference), pin(weight)


def _limit_terms(
    structure: Structure, qpos: jax.Array, qvel: jax.Array, pin: Pin
) -> tuple[jax.Array, jax.Array, jax.Array]:
    limits = structure.limits
    column = partial(_column, dtype=qpos.dtype)
    pos = jnp.stack([qpos[limit.qpos] for limit in limits])
    vel = jnp.stack([qvel[limit.dof] for limit in limits])
    over_low, under_high = (
        pos - column([limit.low for limit in limits]),
        column([limit.high for limit in limits]) - pos,
    )
    sign = jnp.where(over_low < under_high, 1.0, -1.0)
    stiffness, damping, impedance, depth = _soften(
        [limit.softness for limit in limits], jnp.minimum(over_low, under_high)
    )
    inverse_mass = column([limit.weight for limit in limits])
    weight = jnp.where(
        depth < 0, impedance / jnp.maximum(inverse_mass * (1 - impedance), mujoco.mjMINVAL), 0.0
    )
    return pin(sign), pin(-damping * sign * vel - stiffness * impedance * depth), pin(weight)


def _column(values: Sequence[float], dtype: np.dtype) -> np.ndarray:
    return np.array(values, dtype)[:, None]


def _soften(
    softness: Sequence[Softness], distance: jax.Array
) -> tuple[np.ndarray, np.ndarray, jax.Array, jax.Array]:
    """Stiffness, damping, impedance and distance less margin of constraints [C, L] (computation docs, "Impedance")."""
    column = partial(_column, dtype=distance.dtype)
    low, high, width, mid, power = (column([s.impedance[n] for s in softness]) for n in range(5))
    depth = distance - column([s.margin for s in softness])
    x = jnp.minimum(jnp.abs(depth) / width, 1.0)
    raised = _power(power)
    y = jnp.where(
        x < mid, raised(x) / raised(mid) * mid, 1 - raised(1 - x) / raised(1 - mid) * (1 - mid)
    )
    return (
        column([s.stiffness for s in softness]),
        column([s.damping for s in softness]),
        low + y * (high - low),
        depth,
    )


def _power(power: np.ndarray) -> Callable[..., jax.Array]:
    """x to the power; MuJoCo's default 2 without transcendental functions."""
    return (lambda x: x * x) if np.all(power == 2) else (lambda x: jnp.power(x, power))
