"""Axes of all contacts, to convert velocities and forces to and from the world's axes.

Values are [C, L]; a contact's own directions are normal, first and second tangent.
"""

from collections.abc import Sequence
from typing import Protocol

import jax
import jax.numpy as jnp

from mjxgait.physics.lane_major.lanes import dot
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
class Level:
    """Frames on level ground with the first tangent along the world's x: nothing is turned."""

    def into(self, vector: Components) -> Directions:
        """See `Frames`."""
        x, y, z = vector
        return z, x, y

    def out(self, vector: Directions) -> Components:
        """See `Frames`."""
        normal, first, second = vector
        return first, second, normal

    def stiffness(self, along: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        """See `Frames`."""
        nn, n1, n2, t1, t2 = along
        return t1, t2, nn, jnp.zeros_like(nn), n1, n2


@pytree
class Turned:
    """Frames on level ground. x, y: of the first tangent."""

    x: jax.Array
    y: jax.Array

    def into(self, vector: Components) -> Directions:
        """See `Frames`."""
        (vx, vy, vz), tx, ty = vector, self.x, self.y
        return vz, vx * tx + vy * ty, vy * tx - vx * ty

    def out(self, vector: Directions) -> Components:
        """See `Frames`."""
        (normal, first, second), tx, ty = vector, self.x, self.y
        return first * tx - second * ty, first * ty + second * tx, normal

    def stiffness(self, along: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        """See `Frames`."""
        (nn, n1, n2, t1, t2), tx, ty = along, self.x, self.y
        xx, yy, xy = t1 * tx * tx + t2 * ty * ty, t1 * ty * ty + t2 * tx * tx, (t1 - t2) * tx * ty
        return xx, yy, nn, xy, n1 * tx - n2 * ty, n1 * ty + n2 * tx


@pytree
class Tilted:
    """Frames on other ground. normal, first, second: unit vectors in the world."""

    normal: Components
    first: Components
    second: Components

    def into(self, vector: Components) -> Directions:
        """See `Frames`."""
        return dot(self.normal, vector), dot(self.first, vector), dot(self.second, vector)

    def out(self, vector: Directions) -> Components:
        """See `Frames`."""
        normal, first, second = vector
        x, y, z = (
            self.normal[i] * normal + self.first[i] * first + self.second[i] * second
            for i in range(3)
        )
        return x, y, z

    def stiffness(self, along: Sequence[jax.Array]) -> tuple[jax.Array, ...]:
        """See `Frames`."""
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
