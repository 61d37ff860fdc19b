"""Contacts of blocks with the ground, and limits of hinges, as constraints for the solver.

Contacts' values are [4 n, L]: corner by corner, each of all links.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.batched_trees.dynamics import generalised, tree_rows, velocities
from mjxgait.physics.batched_trees.tree import (
    FAR,
    Dense,
    Surroundings,
    Tree,
    centres,
    frames,
    up,
)
from mjxgait.physics.lane_major.constraints import Constraints, Springs, contact_terms, limit_terms
from mjxgait.physics.lane_major.dynamics import pack
from mjxgait.physics.lane_major.footing import Directions, Level, resistance, spatial
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import Pin, axes, cross, plus, total, turn_each
from mjxgait.physics.lane_major.parameters import Softness
from mjxgait.physics.lane_major.treematrix import Rows
from mjxgait.types import pytree

CORNERS = 4
IMPEDANCE = np.array([0.9, 0.95, 0.001, 0.5], np.float32).reshape(1, 4, 1)
POWER = (2.0,)
"""MuJoCo's default `solimp`."""
TIME_CONSTANT = 0.02
"""s, MuJoCo's default `solref`, used for the limits of hinges."""
LEVEL = Level()


@pytree
class Touch:
    """Geometry of all contacts.

    distance: [4 n, L] m above the ground, `FAR` for missing blocks and in water.
    points: x, y, z [4 n, L] m from the origin.
    """

    distance: jax.Array
    points: tuple[jax.Array, jax.Array, jax.Array]


def lowest_corners(tree: Tree, poses: Sequence[Pose]) -> Touch:
    """Find the four corners of each block below its centre: those that may touch a plane.

    K, A and B are the half axes pointing down; K is the steepest. The corners are K + A + B,
    K + A - B, K - A + B, and K - A - B or, if that is above the centre, its opposite.
    """
    rot = frames(poses)
    halves = [turn_each(rot, tree.axes[:, k] * tree.half[:, k, None]) for k in range(3)]
    down = [[-jnp.where(half[2] > 0, 1.0, -1.0) * x for x in half] for half in halves]
    steep = [half[2] for half in down]
    first = (steep[0] <= steep[1]) & (steep[0] <= steep[2])
    last = ~first & (steep[2] < steep[1])
    most = [jnp.where(first, x, jnp.where(last, z, y)) for x, y, z in zip(*down, strict=True)]
    one = [jnp.where(first, y, x) for x, y in zip(down[0], down[1], strict=True)]
    other = [jnp.where(last, y, z) for y, z in zip(down[1], down[2], strict=True)]
    below = jnp.where(most[2] - one[2] - other[2] > 0, -1.0, 1.0)
    x, y, z = (
        jnp.concatenate([c + k + a + b, c + k + a - b, c + k - a + b, c + below * (k - a - b)])
        for c, k, a, b in zip(centres(tree, poses), most, one, other, strict=True)
    )
    distance = z + poses[0].origin[2]
    there = jnp.concatenate([tree.solid] * CORNERS) > 0
    return Touch(jnp.where(there, distance, FAR), (x, y, z - 0.5 * distance))


@dataclasses.dataclass(frozen=True)
class BlockFooting:
    """Operators of the contact Jacobian in one state; compare `lane_major.footing`."""

    tree: Tree
    turns: jax.Array
    freedom: Motion
    points: tuple[jax.Array, jax.Array, jax.Array]
    pin: Pin

    def along(self, vector: Sequence[jax.Array]) -> Directions:
        """J x for x [nv] of [L]."""
        moving = velocities(self.tree, self.turns, self.freedom, vector, self.pin)
        motion = jnp.concatenate([moving] * CORNERS)
        velocity = plus(axes(motion[:, 3:]), cross(axes(motion), self.points))
        return self.pin(LEVEL.into((velocity[0], velocity[1], velocity[2])))

    def gathered(self, force: Directions) -> dict[int, jax.Array]:
        """J^T f: [L] per degree of freedom."""
        pull = LEVEL.out(force)
        wrench = self._folded([*cross(self.points, pull), *pull])
        shares = generalised(self.tree, self.turns, self.freedom, wrench, self.pin)
        return dict(enumerate(self.pin(shares)))

    def stiffened(self, mass: Rows, stiffness: Sequence[jax.Array]) -> Rows:
        """Rows of M + J^T D J; stiffness as in `lane_major.footing`."""
        held = up(
            self.tree, self._folded(spatial(LEVEL.stiffness(stiffness), self.points)), self.pin
        )
        entries = [held[:, c] for c in range(21)]
        force = Motion(*_halves(resistance(entries, self.freedom)))
        spin = (self.turns[:, 0], self.turns[:, 1], self.turns[:, 2])
        turning = Motion(spin, (0.0, 0.0, 0.0))
        root = Motion(*_halves(resistance([held[0, c] for c in range(21)], turning)))
        rows = tree_rows(self.tree, self.turns, self.freedom, force, root, self.pin)
        xx, yy, zz, xy, xz, yz = (held[0, c] for c in range(15, 21))
        rows[:3] = [jnp.stack([xx]), jnp.stack([xy, yy]), jnp.stack([xz, yz, zz])]
        return tuple(a + b for a, b in zip(mass, rows, strict=True))

    def _folded(self, values: Sequence[jax.Array]) -> jax.Array:
        """Sum contacts' components [4 n, L] over each block: [n, components, L]."""
        n = self.tree.links
        corners = [[value[k * n : (k + 1) * n] for k in range(CORNERS)] for value in values]
        return pack([total(corner) for corner in corners], self.pin)


def make_constraints(
    tree: Tree,
    around: Surroundings,
    footing: BlockFooting,
    touch: Touch | None,
    friction: jax.Array,
    qpos: jax.Array,
    qvel: jax.Array,
) -> Constraints:
    """Make the constraints of this state: all corners, all limits. friction: [L], a factor."""
    pin, shape = footing.pin, Dense(tree.links, around.iterations, around.line_iterations)
    over_low, under_high = qpos[7:] - tree.low[1:], tree.high[1:] - qpos[7:]
    hinges = Springs(_softness(max(TIME_CONSTANT, 2 * around.step)), POWER, tree.dof_weight[1:])
    limit = limit_terms(hinges, over_low, under_high, qvel[6:], pin)
    if touch is None:
        empty = jnp.zeros((0, *friction.shape), friction.dtype)
        return Constraints(shape, None, empty, (empty, empty, empty), empty, *limit)
    softness = _softness(around.contact)
    corners = Springs(softness, POWER, jnp.concatenate([tree.body_weight] * CORNERS))
    mu = jnp.broadcast_to(around.friction * friction, touch.distance.shape)
    contact = contact_terms(corners, touch.distance, mu, footing.along(list(qvel)), pin)
    return Constraints(shape, footing, *contact, *limit)


def _softness(time_constant: float) -> Softness:
    """Softness of a critically damped constraint (computation docs, "Reference")."""
    time = float(IMPEDANCE[0, 1, 0]) * time_constant
    stiffness, damping, none = (
        np.full((1, 1), x, np.float32) for x in (1 / time**2, 2 / time, 0.0)
    )
    return Softness(stiffness, damping, IMPEDANCE, none)


def _halves(
    values: tuple[jax.Array, ...],
) -> tuple[tuple[jax.Array, jax.Array, jax.Array], tuple[jax.Array, jax.Array, jax.Array]]:
    a, b, c, d, e, f = values
    return (a, b, c), (d, e, f)
