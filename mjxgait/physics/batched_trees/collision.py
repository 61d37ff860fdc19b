"""Forces between the blocks of two bodies: one spring, damper and friction per pair of blocks.

A block counts as a smaller box, its core, with a rounded hull around it. Where the cores of two
blocks come nearer than both hulls are thick, their nearest points press on each other. A core
inside another is pushed out from middle to middle. Explicit, so soft enough for the time step.

Letters: `n`, `m` blocks of one body and of the other, `L` lanes.
"""

from collections.abc import Iterable

import jax
import jax.numpy as jnp

from mjxgait.physics.lane_major.lanes import Pin, Scalar, Vector, cross, dot, minus, plus, total
from mjxgait.types import pytree

ROUND = 0.5
"""Thickness of a hull over the block's least half size."""
PROJECTIONS = 3
"""Steps that find the nearest points, each to the nearest point of the other core."""
STEPS = 4.0
"""A contact's time constant, in time steps."""
FRICTION = 0.9
SHARE = 0.25
"""Largest share of a sliding velocity that friction stops in a step."""
NEAR = 1e-5
"""m; points that are nearer have no direction."""


@pytree
class Boxes:
    """Blocks of a body, in the world; vectors have components [n, L].

    middle: m. axes: the own axes. half: m along these. mass: [n, L] kg. solid: [n, L] 1 for those
    that exist. spin: rad/s. drift: m/s of the middle.
    """

    middle: Vector
    axes: tuple[Vector, Vector, Vector]
    half: Vector
    mass: jax.Array
    solid: jax.Array
    spin: Vector
    drift: Vector

    @property
    def hull(self) -> jax.Array:
        """Thickness [n, L] m of the rounded hull."""
        x, y, z = self.half
        return ROUND * jnp.minimum(jnp.minimum(x, y), z)

    def nearest(self, point: Vector) -> Vector:
        """Return the point of the core that is nearest to a point."""
        x, y, z = self.half
        core = (x - self.hull, y - self.hull, z - self.hull)
        return nearest_in_box(self.middle, self.axes, core, point)

    def velocity(self, arm: Vector) -> Vector:
        """Return the velocity of the point at an arm from the middle."""
        return vector(plus(self.drift, cross(self.spin, arm)))


def nearest_in_box(
    middle: Vector, own: tuple[Vector, Vector, Vector], half: Vector, point: Vector
) -> Vector:
    """Return the point of a box that is nearest to a point. own: its axes. half: m along these."""
    away = minus(point, middle)
    along = [
        jnp.clip(dot(axis, away), -reach, reach) for axis, reach in zip(own, half, strict=True)
    ]
    return vector(
        m + total([a * axis[c] for a, axis in zip(along, own, strict=True)])
        for c, m in enumerate(middle)
    )


def pushes(one: Boxes, other: Boxes, step: float, pin: Pin) -> tuple[jax.Array, jax.Array]:
    """Return moment about its middle and force on each block: [n, 6, L] and [m, 6, L].

    N·m and N. step: s.
    """
    a: Boxes = jax.tree.map(lambda leaf: leaf[:, None], one)
    b: Boxes = jax.tree.map(lambda leaf: leaf[None], other)
    here, there = _nearest_points(a, b, pin)
    between = vector(minus(a.middle, b.middle))
    outward, distance = pin(_direction(vector(minus(here, there)), between))
    depth = a.hull + b.hull - distance
    touching = (depth > 0) & (a.solid * b.solid > 0)
    at = vector(0.5 * (x + y) for x, y in zip(here, there, strict=True))
    mine, its = vector(minus(at, a.middle)), vector(minus(at, b.middle))
    slip = pin(vector(minus(a.velocity(mine), b.velocity(its))))
    pulled = _force(slip, outward, depth, a.mass * b.mass / (a.mass + b.mass + NEAR), step)
    force = pin(vector(jnp.where(touching, f, 0.0) for f in pulled))
    ours, theirs = (*cross(mine, force), *force), (*cross(its, force), *force)
    first, second = range(len(one.mass)), range(len(other.mass))
    on_one = [total([x[:, j] for j in second]) for x in ours]
    on_other = [-total([x[i] for i in first]) for x in theirs]
    return jnp.stack(on_one, axis=1), jnp.stack(on_other, axis=1)


def _nearest_points(a: Boxes, b: Boxes, pin: Pin) -> tuple[Vector, Vector]:
    """Return the nearest points of the cores of each pair, components [n, m, L]."""
    there = vector(y + 0.0 * x for x, y in zip(a.middle, b.middle, strict=True))
    here = there
    for _ in range(PROJECTIONS):
        here = pin(a.nearest(there))
        there = pin(b.nearest(here))
    return here, there


def _direction(apart: Vector, between: Vector) -> tuple[Vector, jax.Array]:
    """Return the unit vector along `apart`, or along `between` if that is zero, and its length."""
    distance = jnp.sqrt(dot(apart, apart))
    met, length = distance < NEAR, jnp.sqrt(dot(between, between)) + NEAR
    safe = jnp.where(met, 1.0, distance)
    outward = vector(
        jnp.where(met, middle / length, x / safe) for x, middle in zip(apart, between, strict=True)
    )
    return outward, distance


def _force(slip: Vector, outward: Vector, depth: jax.Array, mass: jax.Array, step: float) -> Vector:
    """Return the force on the first block. slip: m/s against the other. mass: kg, reduced."""
    time, leaving = STEPS * step, dot(slip, outward)
    normal = jnp.maximum(mass / time**2 * depth - mass / time * leaving, 0.0)
    along = vector(s - leaving * o for s, o in zip(slip, outward, strict=True))
    speed = jnp.sqrt(dot(along, along)) + NEAR
    grip = jnp.minimum(FRICTION * normal, SHARE * mass / step * speed) / speed
    return vector(normal * o - grip * a for o, a in zip(outward, along, strict=True))


def gap(boxes: Boxes, point: Vector) -> jax.Array:
    """Return the distance [L] in m from a point, components [L], to the nearest block."""
    away = vector(p[None] - m for p, m in zip(point, boxes.middle, strict=True))
    beyond = [
        jnp.maximum(abs(dot(axis, away)) - half, 0.0)
        for axis, half in zip(boxes.axes, boxes.half, strict=True)
    ]
    distance = jnp.sqrt(dot(beyond, beyond))
    return jnp.min(jnp.where(boxes.solid > 0, distance, jnp.inf), axis=0)


def vector(components: Iterable[Scalar]) -> Vector:
    """Return three components as a vector."""
    x, y, z = components
    return x, y, z
