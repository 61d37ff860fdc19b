"""Water that resists the faces of blocks (Sims 1994, section 5.2)."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from mjxgait.physics.batched_trees.motion import frames
from mjxgait.physics.batched_trees.tree import Tree
from mjxgait.physics.lane_major.dynamics import Inertia, pack, unpack
from mjxgait.physics.lane_major.kinematics import Pose
from mjxgait.physics.lane_major.lanes import (
    Pin,
    cross,
    dot,
    plus,
    turn_each,
)


def drag_links(
    tree: Tree, poses: Sequence[Pose], body: Inertia, moving: jax.Array, drag: float, pin: Pin
) -> jax.Array:
    """Water's force on each link, [n, 6, L] about the origin; moving: [n, 6, L].

    Every point of a face is pushed along its normal by `drag` N·s/m³ times its velocity along it.
    Summed over the six faces of a block, this gives a force against the velocity of its centre and
    a moment against its rotation, both diagonal in the block's own axes.
    """
    velocity = unpack(moving)
    mass = jnp.where(tree.solid > 0, tree.mass, 1.0)
    centre = tuple(h / mass for h in body.moment)
    drift = plus(velocity.shift, cross(velocity.spin, (centre[0], centre[1], centre[2])))
    rot = frames(poses)
    push: list[jax.Array] = [jnp.zeros_like(mass)] * 3
    twist: list[jax.Array] = [jnp.zeros_like(mass)] * 3
    for k in range(3):
        axis, (i, j) = turn_each(rot, tree.axes[:, k]), ((k + 1) % 3, (k + 2) % 3)
        a, b, c = (tree.half[:, n] for n in (k, i, j))
        slow = -8 * drag * b * c * tree.solid * dot(axis, drift)
        # A point of face i or j moves along the normal in proportion to its distance from the axis.
        still = -8 / 3 * drag * a * (b**3 + c**3) * tree.solid * dot(axis, velocity.spin)
        push = [p + slow * x for p, x in zip(push, axis, strict=True)]
        twist = [t + still * x for t, x in zip(twist, axis, strict=True)]
    moment = plus(twist, cross((centre[0], centre[1], centre[2]), (push[0], push[1], push[2])))
    return pack([*moment, *push], pin)
