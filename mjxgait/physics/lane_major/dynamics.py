"""Mass matrix and bias forces: composite-rigid-body and recursive Newton-Euler algorithms.

Featherstone, "Rigid Body Dynamics Algorithms", chapters 5 and 6. All bodies are in the one frame of
`kinematics`, as in MuJoCo's computation chapter. The only recursions are then sums along the tree,
`down` and `up`; everything else is done for all bodies at once. Values of bodies or degrees of
freedom are [n, L] per component, or packed for the sums as [n, components, L].
"""

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.derived import inverse_weights, weight_groups
from mjxgait.physics.lane_major.kinematics import Motion, Pose, motions, posture
from mjxgait.physics.lane_major.lanes import (
    Pin,
    Scalar,
    Vector,
    axes,
    column,
    cross,
    dot,
    minus,
    pinned_by,
    plus,
    scale,
    table,
    total,
    turn_each,
)
from mjxgait.physics.lane_major.parameters import Parameters
from mjxgait.physics.lane_major.structure import Structure, join, scalars
from mjxgait.physics.lane_major.topology import Topology
from mjxgait.physics.lane_major.treematrix import (
    BALL,
    FREE,
    FREEDOMS,
    HINGE,
    SLIDE,
    BodySlot,
    Rows,
    on_pivot,
)
from mjxgait.types import Number

CARRIES = {FREE: ((0, 3), (3, 3)), BALL: ((0, 3),), SLIDE: ((0, 1),), HINGE: ((0, 1),)}
"""Groups (first, count) of degrees of freedom per joint type; each group carries the next."""


@dataclasses.dataclass(frozen=True)
class Inertia:
    """Spatial inertia about the origin.

    turning: xx, yy, zz, xy, xz, yz in kg m^2. moment: mass times centre in kg m. mass: kg.
    """

    turning: tuple[Scalar, ...]
    moment: Vector
    mass: Scalar

    def times(self, motion: Motion) -> Motion:
        """Momentum of a velocity, or force of an acceleration: (moment about the origin, force)."""
        xx, yy, zz, xy, xz, yz = self.turning
        turned = (
            dot((xx, xy, xz), motion.spin),
            dot((xy, yy, yz), motion.spin),
            dot((xz, yz, zz), motion.spin),
        )
        shifted = minus(scale(self.mass, motion.shift), cross(self.moment, motion.spin))
        return Motion(plus(turned, cross(self.moment, motion.shift)), shifted)


class Masses(Protocol):
    """Masses and inertias of bodies: see `Parameters`, with the lanes innermost."""

    @property
    def mass(self) -> Number:
        """[B, L] kg."""
        ...

    @property
    def com(self) -> Number:
        """[B, 3, L] m."""
        ...

    @property
    def axes(self) -> Number:
        """[B, 2 or 3, 3, L] principal axes."""
        ...

    @property
    def inertia(self) -> Number:
        """[B, 3, L] kg m^2."""
        ...


def inertias(x: Masses, poses: Sequence[Pose], like: jax.Array, pin: Pin) -> Inertia:
    """Spatial inertias of all bodies."""
    pos = pin(table([pose.pos for pose in poses], like))
    rot = [pin(table([pose.rot[j] for pose in poses], like)) for j in range(3)]
    center = pin(plus(axes(pos), turn_each(rot, x.com)))
    first, second = pin((turn_each(rot, x.axes[:, 0]), turn_each(rot, x.axes[:, 1])))
    # The third moment goes to the identity, what the other two differ from it to their axes.
    least, mass = x.inertia[:, 2], x.mass
    a, b = x.inertia[:, 0] - least, x.inertia[:, 1] - least

    def entry(i: int, j: int) -> jax.Array:
        own = a * first[i] * first[j] + b * second[i] * second[j] - mass * center[i] * center[j]
        return own + (least + mass * dot(center, center)) if i == j else own

    turning = tuple(entry(i, j) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return Inertia(pin(turning), pin(scale(mass, center)), mass)


def pack(parts: Sequence[jax.Array], pin: Pin) -> jax.Array:
    """Stack components [n, L] into one array [n, components, L]."""
    return pin(jnp.stack(parts, axis=1))


def unpack(packed: jax.Array) -> Motion:
    """Split [n, 6, L] into its six components."""
    return Motion(axes(packed), axes(packed[:, 3:]))


def down(
    structure: Structure, steps: jax.Array, start: Number, pin: Pin
) -> tuple[list[jax.Array], jax.Array]:
    """Sum from the root: [6, L] per body, and [nv, 6, L] before each degree of freedom.

    steps: [nv, 6, L], what each degree of freedom adds. start: [6, 1 or L], of the world.
    """
    after: list[jax.Array] = []
    before: list[jax.Array] = []
    for body in structure.topology.bodies:
        value = jnp.broadcast_to(start, steps.shape[1:]) if body.parent < 0 else after[body.parent]
        for group in _groups(body):
            before.extend([value] * len(group))
            value = pin(total([value, *(steps[k] for k in group)]))
        after.append(value)
    return after, pin(jnp.stack(before))


def up(structure: Structure, own: jax.Array, pin: Pin) -> list[jax.Array]:
    """Sum own [B, components, L] over each body and all below: [components, L] per body."""
    sums = list(own)
    for b in reversed(range(len(sums))):
        below = [sums[c] for c, body in enumerate(structure.topology.bodies) if body.parent == b]
        sums[b] = pin(total([own[b], *below])) if below else own[b]
    return sums


def _groups(body: BodySlot) -> list[range]:
    return [
        range(j.dof + first, j.dof + first + count)
        for j in body.joints
        for first, count in CARRIES[j.kind]
    ]


def motion_cross(a: Motion, b: Motion) -> Motion:
    """Rate of change of a motion b carried along by a."""
    return Motion(cross(a.spin, b.spin), plus(cross(a.spin, b.shift), cross(a.shift, b.spin)))


def force_cross(a: Motion, force: Motion) -> Motion:
    """Rate of change of a momentum carried along by a."""
    return Motion(
        plus(cross(a.spin, force.spin), cross(a.shift, force.shift)), cross(a.spin, force.shift)
    )


def bias_force(
    structure: Structure,
    body: Inertia,
    freedom: Motion,
    qvel: jax.Array,
    gravity: Vector,
    pin: Pin,
) -> tuple[jax.Array, list[jax.Array]]:
    """Bias force (`qfrc_bias`) [nv, L] and every body's velocity [6, L].

    Sum of Coriolis, centrifugal and gravity forces.
    """
    steps = Motion(scale(qvel, freedom.spin), scale(qvel, freedom.shift))
    moving, before = down(structure, pack(steps.parts, pin), np.zeros((6, 1), qvel.dtype), pin)
    carried = motion_cross(unpack(before), steps)
    upwards = -column((0.0, 0.0, 0.0, *gravity), qvel.dtype)
    swept, _ = down(structure, pack(carried.parts, pin), upwards, pin)
    velocity = unpack(pin(jnp.stack(moving)))
    momentum = body.times(velocity)
    momentum = Motion(pin(momentum.spin), pin(momentum.shift))
    inert, whirling = body.times(unpack(pin(jnp.stack(swept)))), force_cross(velocity, momentum)
    own = [a + b for a, b in zip(inert.parts, whirling.parts, strict=True)]
    force = unpack(by_dof(structure, up(structure, pack(own, pin), pin), pin))
    return dot(freedom.parts, force.parts), moving


def by_dof(structure: Structure, bodies: Sequence[jax.Array], pin: Pin) -> jax.Array:
    """Return per degree of freedom the value [components, L] of the body that it moves."""
    return pin(jnp.stack([bodies[b] for b in structure.topology.dof_body]))


def mass_rows(
    structure: Structure, body: Inertia, freedom: Motion, paths: dict[int, jax.Array], pin: Pin
) -> Rows:
    """Rows of the mass matrix; paths: see `motion_paths`."""
    like = body.moment[0]
    mass = jnp.broadcast_to(body.mass, like.shape)
    composite = by_dof(
        structure, up(structure, pack([*body.turning, *body.moment, mass], pin), pin), pin
    )
    parts = [composite[:, c] for c in range(10)]
    force = pin(
        Inertia(tuple(parts[:6]), (parts[6], parts[7], parts[8]), parts[9]).times(freedom).parts
    )
    first = root_freedoms(structure)
    head = rooted(force, root_axes(freedom), pin) if first else None
    rows = []
    for k, chain in enumerate(structure.pattern.chains):
        path = paths[k][first : len(chain)]
        row = total([f[k] * path[:, c] for c, f in enumerate(force)])
        if head is not None:
            row = head[k, : k + 1] if k < first else jnp.concatenate([head[k], row])
        rows.append(on_pivot(row, structure.columns.armature[k]))
    return tuple(rows)


def root_freedoms(structure: Structure) -> int:
    """Count the degrees of freedom of a free root that carries everything; 0 for another root."""
    bodies = structure.topology.bodies
    alone = sum(body.parent < 0 for body in bodies) == 1
    return 6 if alone and [j.kind for j in bodies[0].joints] == [FREE] else 0


def root_axes(freedom: Motion) -> jax.Array:
    """Axes [3, 3, L] about which a free root turns; its shifts follow the world's."""
    return jnp.stack([part[3:6] for part in freedom.spin], axis=1)


def rooted(force: Sequence[jax.Array], turns: jax.Array, pin: Pin) -> jax.Array:
    """Project forces [n, L] (moment before force) onto the six motions of a free root: [n, 6, L].

    A third of the work of six inner products, for most entries of the root's unit motions are zero.
    """
    turned = total([force[c][:, None] * turns[None, :, c] for c in range(3)])
    return pin(jnp.concatenate([jnp.stack(force[3:], axis=1), turned], axis=1))


def motion_paths(structure: Structure, freedom: Motion, pin: Pin) -> dict[int, jax.Array]:
    """Return per degree of freedom the motions [n, 6, L] along a chain that starts with its own.

    Degrees of freedom below each other share a chain.
    """
    packed = pack(freedom.parts, pin)
    paths: dict[int, jax.Array] = {}
    for k in reversed(range(len(structure.pattern.chains))):
        if k not in paths:
            chain = structure.pattern.chains[k]
            path = pin(jnp.concatenate([packed[i : i + n] for i, n in _runs(chain)]))
            paths.update({i: path for i in chain if i not in paths})
    return paths


def _runs(chain: Sequence[int]) -> list[tuple[int, int]]:
    """Group successive numbers as (first, count)."""
    runs: list[tuple[int, int]] = []
    for i in chain:
        if runs and i == sum(runs[-1]):
            runs[-1] = (runs[-1][0], runs[-1][1] + 1)
        else:
            runs.append((i, 1))
    return runs


def reweighed(topology: Topology, parameters: Parameters) -> Parameters:
    """Recompute the weights of one body's contacts and limits."""
    numbers = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), parameters)
    structure = join(topology, numbers, np.dtype(np.float32))
    groups = weight_groups([joint.kind for joint in topology.joints])
    body, dof = inverse_weights(*_at_rest(structure), groups)
    carried = np.array([contact.body for contact in topology.contacts], int)
    limited = np.array([limit.dof for limit in topology.limits], int)
    return dataclasses.replace(
        numbers,
        contacts=dataclasses.replace(numbers.contacts, weight=body[carried, 0]),
        limits=dataclasses.replace(numbers.limits, weight=dof[limited]),
    )


def _at_rest(structure: Structure) -> tuple[jax.Array, jax.Array]:
    """Mass matrix [nv, nv] and centres' Jacobian [B, 6, nv] of one lane at rest."""
    topology, like = structure.topology, jnp.ones(1, jnp.float32)
    pin = pinned_by(like)
    poses, freedoms = posture(structure, _rest(structure), pin)
    freedom = motions(freedoms, like, pin)
    paths = motion_paths(structure, freedom, pin)
    rows = mass_rows(structure, inertias(structure.columns, poses, like, pin), freedom, paths, pin)
    lower = jnp.zeros((len(rows), len(rows)), like.dtype)
    for k, chain in enumerate(topology.pattern.chains):
        lower = lower.at[k, np.array(chain)].set(rows[k][:, 0])
    spin, shift = (jnp.stack([x[:, 0] for x in v], axis=1) for v in (freedom.spin, freedom.shift))
    centres = jnp.stack(
        [
            jnp.broadcast_to(pose.point(scalars(com)), (3, 1))[:, 0]
            for pose, com in zip(poses, structure.exact.com, strict=True)
        ]
    )
    moved = shift + jnp.cross(spin, centres[:, None])
    jacobian = jnp.concatenate([moved, jnp.broadcast_to(spin, moved.shape)], axis=2)
    jacobian = jnp.where(_moves(topology)[:, :, None], jacobian, 0.0)
    return lower + jnp.tril(lower, -1).T, jnp.swapaxes(jacobian, 1, 2)


def _rest(structure: Structure) -> jax.Array:
    """MuJoCo's qpos0 [nq, 1], with free roots at the origin, which leaves the weights unchanged."""
    rest = []
    for joint in (joint for body in structure.bodies for joint in body.joints):
        if joint.kind == FREE:
            rest += [0.0] * 3
        turns = joint.kind in (FREE, BALL)
        rest += [1.0, 0.0, 0.0, 0.0] if turns else [joint.reference]
    return jnp.stack([jnp.broadcast_to(value, 1) for value in rest]).astype(jnp.float32)


def _moves(topology: Topology) -> np.ndarray:
    """[B, nv]: True if a degree of freedom moves a body."""
    moves = np.zeros((len(topology.bodies), len(topology.dof_parent)), bool)
    for b, body in enumerate(topology.bodies):
        if body.parent >= 0:
            moves[b] = moves[body.parent]
        for joint in body.joints:
            moves[b, joint.dof : joint.dof + FREEDOMS[joint.kind]] = True
    return moves
