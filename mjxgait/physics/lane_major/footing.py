"""Axes of all contacts, and their Jacobian J, never written out.

Each contact is a point of a body, and bodies move as the tree moves them. J x is the velocity of
the points when x moves the tree: a sum down the tree. J^T f gathers the points' forces at their
bodies and sums them up the tree. J^T D J is the mass matrix's own recursion with the contacts'
stiffness instead of inertia (Featherstone, "Rigid Body Dynamics Algorithms", chapter 6). So a
further contact on a body costs a few dozen operations, however long its chain.

Values of contacts are [C, L] along normal, first and second tangent; those of a body are [6, L],
angular before linear, or [21, L].
"""

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import jax
import jax.numpy as jnp
from typing_extensions import override

from mjxgait.physics.lane_major.dynamics import rooted
from mjxgait.physics.lane_major.kinematics import Motion
from mjxgait.physics.lane_major.lanes import Pin, axes, cross, dot, parts, plus, total
from mjxgait.physics.lane_major.structure import Structure
from mjxgait.physics.lane_major.treematrix import Carriers, Rows
from mjxgait.types import pytree

Directions = tuple[jax.Array, jax.Array, jax.Array]
"""Normal, first and second tangent, [C, L] each."""
Components = tuple[jax.Array, jax.Array, jax.Array]
"""Along the world's x, y and z, [C, L] each."""


class Frames(Protocol):
    """Axes of all contacts."""

    def into(self, vector: Components) -> Directions:
        """Convert a vector of the world to a contact's directions."""
        ...

    def out(self, vector: Directions) -> Components:
        """Convert a vector along a contact's directions to the world."""
        ...

    def stiffness(self, along: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        """Convert D along nn, n1, n2, 11 and 22 (zero along 12) to xx, yy, zz, xy, xz, yz."""
        ...


@pytree
class Level(Frames):
    """Frames on level ground with the first tangent along the world's x: nothing is turned."""

    @override
    def into(self, vector: Components) -> Directions:
        x, y, z = vector
        return z, x, y

    @override
    def out(self, vector: Directions) -> Components:
        normal, first, second = vector
        return first, second, normal

    @override
    def stiffness(self, along: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        nn, n1, n2, t1, t2 = along
        return t1, t2, nn, jnp.zeros_like(nn), n1, n2


@pytree
class Turned(Frames):
    """Frames on level ground. x, y: of the first tangent."""

    x: jax.Array
    y: jax.Array

    @override
    def into(self, vector: Components) -> Directions:
        (vx, vy, vz), tx, ty = vector, self.x, self.y
        return vz, vx * tx + vy * ty, vy * tx - vx * ty

    @override
    def out(self, vector: Directions) -> Components:
        (normal, first, second), tx, ty = vector, self.x, self.y
        return first * tx - second * ty, first * ty + second * tx, normal

    @override
    def stiffness(self, along: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        (nn, n1, n2, t1, t2), tx, ty = along, self.x, self.y
        xx, yy, xy = t1 * tx * tx + t2 * ty * ty, t1 * ty * ty + t2 * tx * tx, (t1 - t2) * tx * ty
        return xx, yy, nn, xy, n1 * tx - n2 * ty, n1 * ty + n2 * tx


@pytree
class Tilted(Frames):
    """Frames on other ground. normal, first, second: unit vectors in the world."""

    normal: Components
    first: Components
    second: Components

    @override
    def into(self, vector: Components) -> Directions:
        return dot(self.normal, vector), dot(self.first, vector), dot(self.second, vector)

    @override
    def out(self, vector: Directions) -> Components:
        normal, first, second = vector
        x, y, z = (
            self.normal[i] * normal + self.first[i] * first + self.second[i] * second
            for i in range(3)
        )
        return x, y, z

    @override
    def stiffness(self, along: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        nn, n1, n2, t1, t2 = along
        n, a, b = self.normal, self.first, self.second
        # Response along the three directions to a shift along each axis of the world.
        felt = [
            (
                nn * n[i] + n1 * a[i] + n2 * b[i],
                n1 * n[i] + t1 * a[i],
                n2 * n[i] + t2 * b[i],
            )
            for i in range(3)
        ]
        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        return tuple(n[j] * felt[i][0] + a[j] * felt[i][1] + b[j] * felt[i][2] for i, j in pairs)


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Moves:
    """Unit motions of degrees of freedom, about and through the tree's origin.

    turns: [3, 3, L] axes of a free root, which turns about the origin and shifts along the world's
      axes; None for another root.
    freedom: [n, 6, L] of the other degrees of freedom.
    paths: [m, 6, L] along chains of them.
    """

    turns: jax.Array | None
    freedom: jax.Array | None
    paths: tuple[jax.Array, ...]

    def along_chains(self, tree: Carriers, force: Sequence[jax.Array], pin: Pin) -> list[jax.Array]:
        """Project each degree of freedom's force [n, L] onto its chain from the root."""
        head = None if self.turns is None else rooted(force, self.turns, pin)
        rows = []
        for place, length in enumerate(tree.lengths):
            path = self.paths[tree.path_of[place]]
            own = total([f[place] * path[:length, c] for c, f in enumerate(force)])
            rows.append(own if head is None else jnp.concatenate([head[place], own]))
        return rows


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Touch:
    """Geometry of all contacts.

    distance: [C, L] m. points: x, y, z from the tree's origin, [C, L] m.
    frames: the contacts' axes.
    moves: of the degrees of freedom that move contacts.
    """

    distance: jax.Array
    points: tuple[jax.Array, jax.Array, jax.Array]
    frames: Frames
    moves: Moves


@dataclasses.dataclass(frozen=True)
class Footing:
    """Operators of the contact Jacobian in one state."""

    structure: Structure
    touch: Touch
    pin: Pin

    def along(self, vector: Sequence[jax.Array]) -> Directions:
        """J x for x, an [nv] list of [L]."""
        tree, moves = self.structure.carriers, self.touch.moves
        turns, freedom = moves.turns, moves.freedom
        moving: dict[int, jax.Array] = {}
        if turns is not None:
            spin = total([turns[j] * vector[3 + j] for j in range(3)])
            moving[tree.root] = self.pin(jnp.concatenate([spin, jnp.stack(vector[:3])]))
        steps: list[jax.Array] = []
        if freedom is not None:
            own = jnp.stack([vector[k] for k in tree.dofs])[:, None]
            steps = list(self.pin(freedom * own))
        for body, parent, places in tree.bodies:
            above = [moving[parent]] if parent in moving else []
            moving[body] = self.pin(total([*above, *(steps[place] for place in places)]))
        slabs = [jnp.broadcast_to(moving[b], (n, *moving[b].shape)) for b, n in tree.contacts]
        motion = self.pin(jnp.concatenate(slabs))
        velocity = plus(axes(motion[:, 3:]), cross(axes(motion), self.touch.points))
        return self.pin(self.touch.frames.into(velocity))

    def gathered(self, force: Directions) -> dict[int, jax.Array]:
        """J^T f: [L] per degree of freedom that moves a contact."""
        pull = self.touch.frames.out(force)
        tree, moves = self.structure.carriers, self.touch.moves
        wrench = self._summed((*cross(self.touch.points, pull), *pull))
        shares: dict[int, jax.Array] = {}
        if moves.turns is not None:
            whole = wrench[tree.root]
            shares = {k: whole[3 + k] for k in range(3)}
            shares |= {3 + j: dot(parts(moves.turns[j]), parts(whole)) for j in range(3)}
        if moves.freedom is not None:
            product = moves.freedom * jnp.stack([wrench[b] for b in tree.body_of])
            share = self.pin(total([product[:, c] for c in range(6)]))
            shares |= {k: share[place] for place, k in enumerate(tree.dofs)}
        return shares

    def stiffened(self, mass: Rows, stiffness: Sequence[jax.Array]) -> Rows:
        """Rows of M + J^T D J.

        stiffness: D of each contact along nn, n1, n2, 11 and 22 (D is zero along 12), [C, L].
        """
        tree, moves = self.structure.carriers, self.touch.moves
        held = self._summed(spatial(self.touch.frames.stiffness(stiffness), self.touch.points))
        rows = dict(enumerate(mass))
        if moves.turns is not None:
            xx, yy, zz, xy, xz, yz = held[tree.root][15:]
            slides = [jnp.stack([xx]), jnp.stack([xy, yy]), jnp.stack([xz, yz, zz])]
            turning = Motion(axes(moves.turns), (0.0, 0.0, 0.0))
            held_root = [held[tree.root][c] for c in range(21)]
            turned = rooted(resistance(held_root, turning), moves.turns, self.pin)
            rows |= {k: mass[k] + slides[k] for k in range(3)}
            rows |= {3 + j: mass[3 + j] + turned[j, : 4 + j] for j in range(3)}
        if moves.freedom is not None:
            below = jnp.stack([held[b] for b in tree.body_of])
            motion = Motion(axes(moves.freedom), axes(moves.freedom[:, 3:]))
            force = self.pin(resistance([below[:, c] for c in range(21)], motion))
            added = moves.along_chains(tree, force, self.pin)
            rows |= {k: mass[k] + row for k, row in zip(tree.dofs, added, strict=True)}
        return tuple(rows[k] for k in range(len(mass)))

    def _summed(self, values: Sequence[jax.Array]) -> dict[int, jax.Array]:
        """Sum contacts' components [C, L] over each body and all below: [components, L]."""
        tree, packed = self.structure.carriers, self.pin(jnp.stack(values, axis=1))
        own: dict[int, list[jax.Array]] = {}
        first = 0
        for body, count in tree.contacts:
            own[body] = [packed[c] for c in range(first, first + count)]
            first += count
        sums: dict[int, jax.Array] = {}
        root = [] if self.touch.moves.turns is None else [tree.root]
        for body in [*(b for b, _, _ in reversed(tree.bodies)), *root]:
            below = [sums[b] for b, parent, _ in tree.bodies if parent == body]
            sums[body] = self.pin(total([*own.get(body, []), *below]))
        return sums


def spatial(stiffness: Sequence[jax.Array], points: Sequence[jax.Array]) -> list[jax.Array]:
    """Convert a spring's stiffness at a point to the origin: 6 angular, 9 mixed, 6 linear.

    The mixed ones are the force along x, y, z per turn about x, then about y, then about z.
    """
    xx, yy, zz, xy, xz, yz = stiffness
    x, y, z = points
    columns = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    # A turn about x moves the point by (0, -z, y), about y by (z, 0, -x), about z by (-y, x, 0).
    turns = [
        [columns[2][i] * y - columns[1][i] * z for i in range(3)],
        [columns[0][i] * z - columns[2][i] * x for i in range(3)],
        [columns[1][i] * x - columns[0][i] * y for i in range(3)],
    ]
    moments = [cross((x, y, z), (force[0], force[1], force[2])) for force in turns]
    angular = [moments[j][i] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return [*angular, *(component for force in turns for component in force), *stiffness]


def resistance(stiffness: Sequence[jax.Array], motion: Motion) -> tuple[jax.Array, ...]:
    """Moment and force of a spatial stiffness (order: see `spatial`) against a motion."""
    sxx, syy, szz, sxy, sxz, syz = stiffness[:6]
    about = (stiffness[6:9], stiffness[9:12], stiffness[12:15])
    lxx, lyy, lzz, lxy, lxz, lyz = stiffness[15:]
    spin, shift = motion.spin, motion.shift
    moment = plus(
        (dot((sxx, sxy, sxz), spin), dot((sxy, syy, syz), spin), dot((sxz, syz, szz), spin)),
        tuple(dot(column, shift) for column in about),
    )
    turned = tuple(dot([about[j][i] for j in range(3)], spin) for i in range(3))
    pushed = (dot((lxx, lxy, lxz), shift), dot((lxy, lyy, lyz), shift), dot((lxz, lyz, lzz), shift))
    return (*moment, *plus(turned, pushed))
