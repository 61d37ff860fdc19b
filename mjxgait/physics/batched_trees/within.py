"""Blocks of one body that push each other, unless a single joint is between them.

Every two blocks push at one point. The impulses of a step are those that stop the approach which
they would have at its end, and lift them out of each other: a spring explicit in time would be too
soft for the strength of the hinges. They are found in two passes, a guess and its common factor.

Letters: `n` links, `P` pairs of links, `L` lanes.
"""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.batched_trees.collision import FRICTION, NEAR, nearest_in_box, vector
from mjxgait.physics.batched_trees.dynamics import generalised, joints_between, velocities
from mjxgait.physics.batched_trees.tree import FAR, Tree, centres, frames
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import (
    Pin,
    Scalar,
    Vector,
    axes,
    cross,
    dot,
    minus,
    plus,
    scale,
    total,
    turn_each,
)
from mjxgait.physics.lane_major.treematrix import Rows, factor, solve, sparsity
from mjxgait.types import pytree

Values = TypeVar("Values")
"""Pytree of arrays [n, ...]."""
RECOVERY, FASTEST = 0.5, 1.0
"""Share of a depth that a step takes away, and the largest velocity in m/s at which it does."""
MOST = 3.0
"""Largest factor of a guess."""
LEAST = 1e-9
"""Least divisor."""


@pytree
class OwnTouch:
    """Where two blocks meet, components [P, L].

    outward: unit vector from the second block to the first. at: m from the root. depth: m; negative
    where they are apart or never push. mass: kg, that a push moves, roughly.
    """

    outward: Vector
    at: Vector
    depth: jax.Array
    mass: jax.Array


def meeting(tree: Tree) -> jax.Array:
    """Return 1 for each two blocks [n, n] of a body that push each other. Arrays without lanes."""
    return tree.solid[:, None] * tree.solid[None] * (joints_between(tree) > 1)


def touches(tree: Tree, poses: Sequence[Pose], pin: Pin) -> OwnTouch:
    """Return how all blocks of a body meet; `tree.meets` must be known."""
    assert tree.meets is not None
    rot = frames(poses)
    x, y, z = (turn_each(rot, tree.axes[:, k]) for k in range(3))
    blocks = pin(_Boxes(centres(tree, poses), (x, y, z), axes(tree.half)))
    a, b = (pin(_paired(blocks, end)) for end in range(2))
    outward, depth, at = _way_out(a, b)
    met = jnp.stack([tree.meets[i, j] for i, j in _pairs(tree.links)])
    eased = _paired(jnp.maximum(tree.body_weight, LEAST), 0) + _paired(tree.body_weight, 1)
    return pin(OwnTouch(outward, at, jnp.where(met > 0, depth, -FAR), 1 / eased))


def nearest(touch: OwnTouch, links: int) -> jax.Array:
    """Return the distance [n, L] in m from each link's block to the nearest that it can push."""
    found: list[Scalar] = [-FAR] * links
    for (i, j), depth in zip(_pairs(links), touch.depth, strict=True):
        found[i], found[j] = jnp.maximum(found[i], depth), jnp.maximum(found[j], depth)
    return -jnp.stack(found)


@dataclasses.dataclass(frozen=True)
class Pushing:
    """A step of a body with blocks that push each other.

    turns, freedom: motions of the root and of the hinges. mass: rows. step: s.
    """

    tree: Tree
    turns: jax.Array
    freedom: Motion
    mass: Rows
    touch: OwnTouch
    step: float
    pin: Pin

    def force(self, qvel: jax.Array, others: Sequence[jax.Array]) -> jax.Array:
        """Return the generalised force [nv, L] of the pushes. others: [nv] of all other forces."""
        pattern = sparsity(range(-1, len(self.mass) - 1))
        factored = factor(pattern, self.mass)

        def gained(force: Sequence[jax.Array]) -> jax.Array:
            return self.step * jnp.stack(solve(pattern, factored, list(force)))

        slip = self._slips(qvel + gained(others))
        lacking, pressed, force = self._guess(slip)
        guess = self._generalised(force)
        more = dot(self._slips(gained(guess)), self.touch.outward)
        # XLA's CPU compiler refuses a reduction over many pairs in one kernel.
        wanted, reached = total(list(pressed * lacking)), total(list(pressed * more))
        factor_of_all = jnp.clip(wanted / jnp.maximum(reached, LEAST), 0.0, MOST)
        return factor_of_all * jnp.stack(guess)

    def _slips(self, qvel: jax.Array) -> Vector:
        """Return the first block's velocity against the second at each touch, in m/s."""
        moving = velocities(self.tree, self.turns, self.freedom, list(qvel), self.pin)
        apart = self.pin(_paired(moving, 0) - _paired(moving, 1))
        x, y, z = plus(axes(apart[:, 3:]), cross(axes(apart), self.touch.at))
        return self.pin((x, y, z))

    def _guess(self, slip: Vector) -> tuple[jax.Array, jax.Array, Vector]:
        """Return the velocity that each touch lacks, its pressure, and the force on the first."""
        touch, outward = self.touch, self.touch.outward
        leaving = dot(slip, outward)
        lift = jnp.minimum(RECOVERY / self.step * touch.depth, FASTEST)
        lacking = jnp.where(touch.depth > 0, jnp.maximum(lift - leaving, 0.0), 0.0)
        pressed = touch.mass / self.step * lacking
        along = minus(slip, scale(leaving, outward))
        speed = jnp.sqrt(dot(along, along)) + NEAR
        grip = jnp.minimum(FRICTION * pressed, touch.mass / self.step * speed) / speed
        x, y, z = minus(scale(pressed, outward), scale(grip, along))
        return self.pin((lacking, pressed, (x, y, z)))

    def _generalised(self, force: Vector) -> list[jax.Array]:
        """Return [nv] of [L]. force: on the first block of each pair; the opposite on the second."""
        wrench = self.pin(jnp.stack([*cross(self.touch.at, force), *force], axis=1))
        links = _summed(wrench, self.tree.links)
        return generalised(self.tree, self.turns, self.freedom, self.pin(links), self.pin)


@pytree
class _Boxes:
    """Blocks, components [P, L]. own: their axes. half: m along these."""

    middle: Vector
    own: tuple[Vector, Vector, Vector]
    half: Vector

    def nearest(self, point: Vector) -> Vector:
        """Return the point of each block that is nearest to a point."""
        return nearest_in_box(self.middle, self.own, self.half, point)


def _way_out(a: _Boxes, b: _Boxes) -> tuple[Vector, jax.Array, Vector]:
    """Return the shortest way out along a normal of either block: direction, length and place.

    The length is negative where a normal separates them. The place is between the two blocks'
    points that are deepest in each other, along the other normals clipped to where both are.
    """
    between = minus(a.middle, b.middle)
    turned = [[abs(dot(x, y)) for y in b.own] for x in a.own]
    across = [[row[k] for row in turned] for k in range(3)]
    ways = [
        (half + dot(row, other.half) - abs(dot(axis, between)), axis)
        for one, other, rows in ((a, b, turned), (b, a, across))
        for axis, half, row in zip(one.own, one.half, rows, strict=True)
    ]
    depth, best = ways[0]
    for longer, axis in ways[1:]:
        shorter = longer < depth
        depth = jnp.where(shorter, longer, depth)
        best = vector([jnp.where(shorter, x, y) for x, y in zip(axis, best, strict=True)])
    sign = jnp.where(dot(best, between) < 0, -1.0, 1.0)
    outward = vector(scale(sign, best))
    return outward, depth, _middle_of_both(a, b)


def _middle_of_both(a: _Boxes, b: _Boxes) -> Vector:
    """Return a point between two blocks: each one's nearest to the other's middle, then halfway."""
    here, there = a.nearest(b.middle), b.nearest(a.middle)
    here, there = a.nearest(there), b.nearest(here)
    return vector([0.5 * (x + y) for x, y in zip(here, there, strict=True)])


def _spans(count: int) -> Iterator[tuple[int, int]]:
    """Yield distance and number of the pairs: link i and link i + distance, cyclically.

    Half of the largest distance has all pairs if the number of links is even.
    """
    for distance in range(1, count // 2 + 1):
        yield distance, count // 2 if 2 * distance == count else count


def _pairs(count: int) -> list[tuple[int, int]]:
    return [(i, (i + distance) % count) for distance, many in _spans(count) for i in range(many)]


def _paired(values: Values, end: int) -> Values:
    """Return the values of each pair's first (0) or second (1) link. Leaves: [n, ...]."""

    def of(leaf: jax.Array) -> jax.Array:
        return jnp.concatenate(
            [jnp.roll(leaf, -distance * end, axis=0)[:many] for distance, many in _spans(len(leaf))]
        )

    found: Values = jax.tree.map(of, values)
    return found


def _summed(wrench: jax.Array, count: int) -> jax.Array:
    """Add [P, 6, L] to each pair's first link, and subtract it from its second: [n, 6, L]."""
    spans = list(_spans(count))
    found = []
    for (distance, many), part in zip(
        spans, jnp.split(wrench, np.cumsum([many for _, many in spans])[:-1]), strict=True
    ):
        whole = jnp.pad(part, ((0, count - many), (0, 0), (0, 0)))
        found.append(whole - jnp.roll(whole, distance, axis=0))
    return total(found)
