"""The ground in the compiled program: height, slope and contact as pure functions of its numbers.

All is analytic and without a table: a wave consists of parabolas, which cost five operations where
a sine costs twenty-five. Numbers and places broadcast against each other, so the same code serves
one creature ([] and [n]) and lanes innermost ([L] and [n, L]). Kinds of ground:
docs/reference/ground.md.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from mjxgait.creature.ground.spec import GroundSpec, Place
from mjxgait.types import Number, pytree

TREAD = 1.0
"""Length of a step in hip heights."""
RISER = 0.2
"""Share of the tread over which a step rises."""
LENGTHS = {"bumps": (2.0, 2.0), "rough": (1.5, 2.0, 2.7, 3.6, 4.8)}
"""Length of each wave in hip heights."""
DRAWS = max(len(lengths) for lengths in LENGTHS.values())
"""Pairs of random numbers that a ground of any kind takes."""
Vector = tuple[jax.Array, jax.Array, jax.Array]


class Relief(Protocol):
    """Heights by the place ahead and to the left of the start, in m."""

    def rise(self, ahead: jax.Array, left: jax.Array, level: jax.Array) -> Vector:
        """Height in m, and its change per metre ahead and to the left.

        level: m, radius around the start that is level.
        """
        ...


@pytree
class Ground:
    """One trial's ground.

    start: [2] m. forward: [2]. level: [] m, see `Relief`. down: [3] unit vector of gravity; None
    for straight down.
    """

    start: jax.Array
    forward: jax.Array
    level: jax.Array
    relief: Relief
    down: jax.Array | None = None


@pytree
class Slope(Relief):
    """A slope. along, across: [] rise per metre ahead and to the left."""

    along: jax.Array
    across: jax.Array

    def rise(self, ahead: jax.Array, left: jax.Array, level: jax.Array) -> Vector:
        """A slope along the way begins as a parabola a `level` long."""
        beyond = ahead - level
        bend = jnp.clip(beyond, 0.0, level)
        height = self.along * (0.5 * bend * bend / level + jnp.maximum(beyond - level, 0.0))
        full, by_ahead, by_left = _full(ahead, left, level)
        side = self.across * left
        return (
            height + side * full,
            self.along * bend / level + side * by_ahead,
            side * by_left + self.across * full,
        )


@pytree
class Steps(Relief):
    """Stairs. height, tread: [] m of a step. offset: [] share of a tread before the first."""

    height: jax.Array
    tread: jax.Array
    offset: jax.Array

    @override
    def rise(self, ahead: jax.Array, left: jax.Array, level: jax.Array) -> Vector:
        treads = jnp.maximum((ahead - level) / self.tread - self.offset, 0.0)
        whole = jnp.floor(treads)
        up = jnp.clip((treads - whole - (1 - RISER)) / RISER, 0.0, 1.0)
        steep = 6 * up * (1 - up) / (RISER * self.tread)
        height = self.height * (whole + up * up * (3 - 2 * up))
        return height, self.height * steep, jnp.zeros_like(left)


@pytree
class Waves(Relief):
    """Plane waves. size: [W] m. along, across: [W] cycles per metre. phase: [W] cycles."""

    size: jax.Array
    along: jax.Array
    across: jax.Array
    phase: jax.Array

    @override
    def rise(self, ahead: jax.Array, left: jax.Array, level: jax.Array) -> Vector:
        height = by_ahead = by_left = jnp.zeros_like(ahead)
        for w in range(self.size.shape[0]):
            cycles = self.along[w] * ahead + self.across[w] * left + self.phase[w]
            turn = cycles - jnp.round(cycles)
            bow = 1 - 2 * jnp.abs(turn)
            height = height + self.size[w] * 8 * turn * bow
            steep = self.size[w] * 8 * (2 * bow - 1)
            by_ahead = by_ahead + steep * self.along[w]
            by_left = by_left + steep * self.across[w]
        full, full_ahead, full_left = _full(ahead, left, level)
        return (
            height * full,
            by_ahead * full + height * full_ahead,
            by_left * full + height * full_left,
        )


def _full(ahead: jax.Array, left: jax.Array, level: jax.Array) -> Vector:
    """Share of the full height, and its changes per metre.

    0 within `level` of the start, 1 from twice as far on.
    """
    width = 3 * level * level
    share = jnp.clip((ahead * ahead + left * left) / width - 1 / 3, 0.0, 1.0)
    change = 12 * share * (1 - share) / width
    return share * share * (3 - 2 * share), change * ahead, change * left


def lay_ground(spec: GroundSpec, place: Place, draws: Number) -> Ground | None:
    """The ground of a spec under a creature; None where it is flat.

    draws: [DRAWS, 2] in [0, 1): direction and phase of each wave, see `named_draws`.
    """
    if spec.flat:
        return None
    sign = -1.0 if spec.direction == "down" else 1.0
    hip, size = place.hip_height, sign * spec.size
    relief: Relief
    if spec.kind == "slope":
        aside = spec.direction == "across"
        along, across = (0.0, size) if aside else (size, 0.0)
        relief = Slope(jnp.float32(along), jnp.float32(across))
    elif spec.kind == "steps":
        relief = Steps(jnp.float32(size * hip), jnp.float32(TREAD * hip), jnp.float32(draws[0, 1]))
    else:
        relief = _waves(spec, hip, jnp.asarray(draws))
    return _laid(place, relief)


def lay_uneven(
    place: Place, slope: Number | Sequence[float], rough: float, draws: Number
) -> Ground:
    """Rough ground on a slope to any side, which begins at the start, as in the examination.

    Gravity is tilted instead of the ground: a creature stands at right angles to the slope, and
    heights are measured so.

    slope: [2] rise per metre ahead and to the left. rough: hip heights, the most that the waves
    rise or fall. draws: see `lay_ground`.
    """
    waves = _waves(GroundSpec("rough", rough), place.hip_height, jnp.asarray(draws))
    way, rise = jnp.asarray(place.forward, jnp.float32), jnp.asarray(slope, jnp.float32)
    east, north = rise[0] * way[0] - rise[1] * way[1], rise[0] * way[1] + rise[1] * way[0]
    uphill = jnp.stack([east, north, jnp.ones(())])
    return dataclasses.replace(_laid(place, waves), down=-uphill / jnp.linalg.norm(uphill))


def pulled(ground: Ground | None, gravity: Vector) -> Vector:
    """Gravity in m/s² on a ground, from that on level ground; components [] or [L]."""
    if ground is None or ground.down is None:
        return gravity
    x, y, z = gravity
    strength = (x * x + y * y + z * z) ** 0.5
    return strength * ground.down[0], strength * ground.down[1], strength * ground.down[2]


def _laid(place: Place, relief: Relief) -> Ground:
    return Ground(
        jnp.asarray(place.start[:2], jnp.float32),
        jnp.asarray(place.forward[:2], jnp.float32),
        jnp.float32(place.body_length),
        relief,
    )


def _waves(spec: GroundSpec, hip: float, draws: Number) -> Waves:
    """Waves of equal steepness. Rough ground draws their directions, bumps lie crosswise."""
    lengths = np.array(LENGTHS[spec.kind]) * hip
    count = len(lengths)
    drawn = draws[:count, 0] if spec.kind == "rough" else 0.5
    angle = np.pi / count * (np.arange(count) + drawn)
    return Waves(
        size=jnp.float32(spec.size * hip * lengths / lengths.sum()),
        along=jnp.float32(jnp.cos(angle) / lengths),
        across=jnp.float32(jnp.sin(angle) / lengths),
        phase=jnp.float32(draws[:count, 1]),
    )


def named_draws(seed: int) -> np.ndarray:
    """Random numbers [DRAWS, 2] of a seed's ground, from NumPy's frozen Mersenne twister."""
    return np.random.RandomState(seed).random_sample((DRAWS, 2))


def height(ground: Ground, x: jax.Array, y: jax.Array) -> jax.Array:
    """Height in m at places in m."""
    return _surface(ground, x, y)[0]


def normal(ground: Ground, x: jax.Array, y: jax.Array) -> Vector:
    """Unit vector out of the ground at places in m: three components."""
    return _normal(*_surface(ground, x, y)[1:])


def clearance(
    ground: Ground, x: jax.Array, y: jax.Array, z: jax.Array, radius: Number
) -> jax.Array:
    """Distance in m of spheres at these centres to the ground's tangent plane below the centre."""
    below, by_x, by_y = _surface(ground, x, y)
    return (z - below) * _normal(by_x, by_y)[2] - radius


class Contact(NamedTuple):
    """Contact of spheres with the ground: distance in m (negative inside), and its three axes."""

    distance: jax.Array
    normal: Vector
    first: Vector
    second: Vector


def contact(ground: Ground, x: jax.Array, y: jax.Array, z: jax.Array, radius: Number) -> Contact:
    """Contact of spheres at these centres with the ground's tangent plane nearest to them.

    Two evaluations find that plane: below the centre, and at the foot of the perpendicular on the
    plane there. Tangents are those that MuJoCo makes of a normal alone (`mju_makeFrame`).
    """
    below, by_x, by_y = _surface(ground, x, y)
    nx, ny, nz = _normal(by_x, by_y)
    apart = (z - below) * nz
    foot_x, foot_y = x - nx * apart, y - ny * apart
    below, by_x, by_y = _surface(ground, foot_x, foot_y)
    nx, ny, nz = _normal(by_x, by_y)
    distance = (x - foot_x) * nx + (y - foot_y) * ny + (z - below) * nz - radius
    # The world's y less its part along the normal; no ground is steep enough to make y the normal.
    flat = 1 / jnp.sqrt(1 - ny * ny)
    first = -nx * ny * flat, (1 - ny * ny) * flat, -nz * ny * flat
    second = -nz * flat, jnp.zeros_like(nx), nx * flat
    return Contact(distance, (nx, ny, nz), first, second)


def _normal(by_x: jax.Array, by_y: jax.Array) -> Vector:
    up = 1 / jnp.sqrt(1 + by_x * by_x + by_y * by_y)
    return -by_x * up, -by_y * up, up


def _surface(ground: Ground, x: jax.Array, y: jax.Array) -> Vector:
    """Height in m, and its change per metre along the world's x and y."""
    east, north = x - ground.start[0], y - ground.start[1]
    cos, sin = ground.forward[0], ground.forward[1]
    ahead, left = cos * east + sin * north, cos * north - sin * east
    rise, by_ahead, by_left = ground.relief.rise(ahead, left, ground.level)
    return rise, by_ahead * cos - by_left * sin, by_ahead * sin + by_left * cos
