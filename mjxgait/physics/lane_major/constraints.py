"""Contacts with the ground and joint limits as MuJoCo's soft constraints.

Formulas: MuJoCo documentation, "Computation", sections "Constraint model" and "Contact", and MJX's
constraint.py. Values of all contacts lie side by side in arrays [C, L], those of limits in [M, L].

A contact of MuJoCo's pyramidal cone has four edges, normal plus or minus friction times each
tangent. Here it is kept in its three directions (normal, first, second tangent; `footing.Frames`).
Edges are combinations of these, and friction enters late.
"""

import dataclasses
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjxgait.creature.ground.surface import Ground, contact
from mjxgait.physics.lane_major.dynamics import root_axes
from mjxgait.physics.lane_major.footing import (
    Directions,
    Footing,
    Frames,
    Level,
    Moves,
    Tilted,
    Touch,
    Turned,
)
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import Column, Pin, Scalar, add, turn
from mjxgait.physics.lane_major.parameters import Softness
from mjxgait.physics.lane_major.structure import Structure, scalars
from mjxgait.physics.lane_major.treematrix import Carriers, Rows, Sparsity
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
    reference: Any = (
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


def _weight(impedance: Number, depth: jax.Array, inverse: Number) -> jax.Array:
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


class Limited(Protocol):
    """Joint limit."""

    @property
    def dof(self) -> int:
        """Degree of freedom that the limit stops."""
        ...


class Shape(Protocol):
    """Properties that determine the solver's program."""

    @property
    def pattern(self) -> Sparsity:
        """Sparsity of the mass matrix, and of what contacts add to it."""
        ...

    @property
    def limits(self) -> Sequence[Limited]:
        """Limits, in the order of their values."""
        ...

    @property
    def iterations(self) -> int:
        """Maximum number of Newton steps."""
        ...

    @property
    def line_iterations(self) -> int:
        """Maximum number of steps of a line search."""
        ...


class Operators(Protocol):
    """Jacobian J of all contacts, stored in any way."""

    def along(self, vector: Sequence[jax.Array]) -> Directions:
        """J x for x [nv] of [L]."""
        ...

    def gathered(self, force: Directions) -> dict[int, jax.Array]:
        """J^T f: [L] per degree of freedom that moves a contact."""
        ...

    def stiffened(self, mass: Rows, stiffness: Sequence[jax.Array]) -> Rows:
        """Rows of M + J^T D J; D of each contact along nn, n1, n2, 11 and 22."""
        ...


@dataclasses.dataclass(frozen=True)
class Constraints:
    """Constraints of one state, as the solver needs them.

    structure: the shape. footing: the contacts' Jacobian, None without contacts. friction: [C, L].
    reference: what the accelerations along normal and tangents are compared with.
    weight: [C, L] inverse regulariser of an edge, zero where there is no contact.
    sign, limit_reference, limit_weight: [M, L], the same for limits.
    """

    structure: Shape
    footing: Operators | None
    friction: jax.Array
    reference: Directions
    weight: jax.Array
    sign: jax.Array
    limit_reference: jax.Array
    limit_weight: jax.Array

    def along(self, vector: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        """J x of contacts along normal and tangents, three [C, L], and of limits [M, L]."""
        contact = self.footing.along(vector) if self.footing else self.reference
        limits = self.structure.limits
        if not limits:
            return (*contact, self.limit_reference)
        return (*contact, self.sign * jnp.stack([vector[limit.dof] for limit in limits]))


def touch(
    structure: Structure,
    poses: Sequence[Pose],
    freedom: Motion,
    paths: dict[int, jax.Array],
    pin: Pin,
    ground: Ground | None = None,
) -> Touch | None:
    """Find the places of all contacts and the motions that move them.

    paths: see `dynamics.motion_paths`. ground: None for the plane z = 0.
    """
    if not structure.contacts:
        return None
    numbered = enumerate(structure.contacts)
    places = [
        _placed(structure, [n for n, _ in contacts], poses[body])
        for body, contacts in groupby(numbered, key=lambda c: c[1].body)
    ]
    x, y, z, *origin, radius = (
        pin(jnp.concatenate(column)) for column in zip(*places, strict=True)
    )
    moves = _moves(structure.carriers, freedom, paths, pin)
    # MuJoCo puts the contact point half way between the two surfaces.
    if ground is None:
        distance = pin(origin[2] + z - radius)
        points = pin((x, y, z - radius - 0.5 * distance))
        return Touch(distance, points, _level(structure, poses, pin), moves)
    found = contact(ground, origin[0] + x, origin[1] + y, origin[2] + z, radius)
    distance, frames = pin((found.distance, Tilted(*found[1:])))
    deep = radius + 0.5 * distance
    (nx, ny, nz) = frames.normal
    return Touch(distance, pin((x - nx * deep, y - ny * deep, z - nz * deep)), frames, moves)


def _moves(tree: Carriers, freedom: Motion, paths: dict[int, jax.Array], pin: Pin) -> Moves:
    """Collect the motions of the degrees of freedom that move contacts."""
    first = 6 if tree.root >= 0 else 0
    packed = jnp.stack(freedom.parts, axis=1)
    return Moves(
        turns=pin(root_axes(freedom)) if first else None,
        freedom=pin(jnp.stack([packed[k] for k in tree.dofs])) if tree.dofs else None,
        paths=tuple(paths[k][first:] for k in tree.leaves),
    )


def _placed(structure: Structure, places: Sequence[int], pose: Pose) -> tuple[jax.Array, ...]:
    """Place one body's contacts: centres from the origin, the origin and radii, [c, L] each."""
    own = slice(places[0], places[-1] + 1)
    local, radius = structure.columns.contacts.center[own], structure.columns.contacts.radius[own]
    x, y, z = (
        add(*(pose.rot[j][i] * local[:, j] for j in range(3)), _component(pose.pos, i))
        for i in range(3)
    )
    like = jnp.ones_like(x)
    return x, y, z, *(like * _component(pose.origin, i) for i in range(3)), like * radius


def _component(vector: Column, i: int) -> Scalar:
    return vector if isinstance(vector, float) else vector[i]


def _level(structure: Structure, poses: Sequence[Pose], pin: Pin) -> Frames:
    """Frames with the first tangent along a capsule's axis as seen from above.

    The world's y for an upright capsule, and x for a sphere.
    """
    contacts = structure.contacts
    if not any(slot.capsule for slot in contacts):
        return Level()
    like = poses[contacts[0].body].rot[0][0]

    def heading(n: int) -> tuple[jax.Array, jax.Array]:
        if not contacts[n].capsule:
            return jnp.ones_like(like), jnp.zeros_like(like)
        axis = turn(poses[contacts[n].body].rot, scalars(structure.exact.contacts.axis[n]))
        return axis[0], axis[1]

    headings = map(heading, range(len(contacts)))
    x, y = pin(tuple(jnp.stack(part) for part in zip(*headings, strict=True)))
    length = jnp.sqrt(x * x + y * y)
    upright = length < 0.5
    safe = jnp.where(upright, 1.0, length)
    return pin(Turned(jnp.where(upright, 0.0, x / safe), jnp.where(upright, 1.0, y / safe)))


def make_constraints(
    structure: Structure,
    touch: Touch | None,
    friction: jax.Array,
    qpos: jax.Array,
    qvel: jax.Array,
    pin: Pin,
) -> Constraints | None:
    """Make the constraints of the current state; None for a model without any."""
    if not structure.contacts and not structure.limits:
        return None
    empty = jnp.zeros((0, friction.shape[-1]), friction.dtype)
    limit = _limit_terms(structure, qpos, qvel, pin) if structure.limits else (empty, empty, empty)
    if touch is None:
        return Constraints(structure, None, empty, (empty, empty, empty), empty, *limit)
    footing = Footing(structure, touch, pin)
    mu, reference, weight = _contact_terms(footing, friction, qvel)
    return Constraints(structure, footing, mu, reference, weight, *limit)


def _contact_terms(
    footing: Footing, friction: jax.Array, qvel: jax.Array
) -> tuple[jax.Array, Directions, jax.Array]:
    structure, contacts = footing.structure, footing.structure.columns.contacts
    return contact_terms(
        Springs(contacts.softness, structure.topology.contact_power, contacts.weight),
        footing.touch.distance,
        contacts.friction * friction,
        footing.along(list(qvel)),
        footing.pin,
        structure.impratio,
    )


def _limit_terms(
    structure: Structure, qpos: jax.Array, qvel: jax.Array, pin: Pin
) -> tuple[jax.Array, jax.Array, jax.Array]:
    slots, limits = structure.limits, structure.columns.limits
    pos = jnp.stack([qpos[limit.qpos] for limit in slots])
    vel = jnp.stack([qvel[limit.dof] for limit in slots])
    springs = Springs(limits.softness, structure.topology.limit_power, limits.weight)
    return limit_terms(springs, pos - limits.low, limits.high - pos, vel, pin)
