"""Mass matrix and bias forces of trees as data; compare `lane_major.dynamics`."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from mjxgait.physics.batched_trees.motion import down, root_motion, up
from mjxgait.physics.batched_trees.tree import Tree
from mjxgait.physics.lane_major.dynamics import (
    Inertia,
    force_cross,
    motion_cross,
    pack,
    rooted,
    unpack,
)
from mjxgait.physics.lane_major.kinematics import Motion
from mjxgait.physics.lane_major.lanes import (
    Pin,
    cross,
    dot,
    parts,
    scale,
    total,
)
from mjxgait.physics.lane_major.treematrix import Rows, on_pivot


def velocities(
    tree: Tree, turns: jax.Array, freedom: Motion, vector: Sequence[jax.Array], pin: Pin
) -> jax.Array:
    """Velocities [n, 6, L] of all links about the origin; vector: [nv] of [L]."""
    own = jnp.stack([jnp.zeros_like(vector[0]), *vector[6:]])
    steps = pack([own * part for part in freedom.parts], pin)
    return down(tree, jnp.concatenate([root_motion(turns, vector)[None], steps[1:]]), pin)


def bias_links(
    tree: Tree,
    body: Inertia,
    freedom: Motion,
    moving: jax.Array,
    qvel: jax.Array,
    gravity: float,
    pin: Pin,
) -> jax.Array:
    """Force [n, 6, L] that each link's motion needs without acceleration."""
    velocity = unpack(moving)
    speed = jnp.concatenate([jnp.zeros_like(qvel[:1]), qvel[6:]])
    carried = motion_cross(
        velocity, Motion(scale(speed, freedom.spin), scale(speed, freedom.shift))
    )
    # The origin moves along while the root turns; a free joint's shift leaves this out.
    swung = cross(parts(moving[0, 3:]), parts(moving[0, :3]))
    none = jnp.zeros_like(swung[0])
    root = jnp.stack([none, none, none, swung[0], swung[1], swung[2] + gravity])
    own = pack(carried.parts, pin)
    swept = unpack(down(tree, jnp.concatenate([root[None], own[1:]]), pin))
    momentum = body.times(velocity)
    momentum = Motion(pin(momentum.spin), pin(momentum.shift))
    inert, whirling = body.times(swept), force_cross(velocity, momentum)
    return pack([a + b for a, b in zip(inert.parts, whirling.parts, strict=True)], pin)


def generalised(
    tree: Tree, turns: jax.Array, freedom: Motion, force: jax.Array, pin: Pin
) -> list[jax.Array]:
    """Project forces [n, 6, L] on links onto the degrees of freedom, [nv] of [L]."""
    below = up(tree, force, pin)
    along = dot(freedom.parts, [below[:, c] for c in range(6)])
    whole = below[0]
    turning = [dot(parts(turns[j]), parts(whole)) for j in range(3)]
    return [*(whole[3 + k] for k in range(3)), *turning, *(along[j] for j in range(1, tree.links))]


def mass_rows(tree: Tree, turns: jax.Array, freedom: Motion, body: Inertia, pin: Pin) -> Rows:
    """Rows of the mass matrix with armatures; the pivot is 1 where nothing moves."""
    ten = up(tree, pack([*body.turning, *body.moment, body.mass], pin), pin)
    part = [ten[:, c] for c in range(10)]
    composite = Inertia(tuple(part[:6]), (part[6], part[7], part[8]), part[9])
    first = [ten[0, c] for c in range(10)]
    whole = Inertia(tuple(first[:6]), (first[6], first[7], first[8]), first[9])
    rows = tree_rows(tree, turns, freedom, composite.times(freedom), whole.times(_root(turns)), pin)
    slides = [on_pivot(jnp.zeros_like(row), whole.mass) for row in rows[:3]]
    still = tree.armature + (1 - tree.moves)
    hinges = [on_pivot(row, still[j + 1]) for j, row in enumerate(rows[6:])]
    return (*slides, *rows[3:6], *hinges)


def tree_rows(
    tree: Tree, turns: jax.Array, freedom: Motion, force: Motion, root: Motion, pin: Pin
) -> list[jax.Array]:
    """Rows of a matrix like the mass matrix; the caller fills the first three.

    force: [n] against each hinge's unit motion, root: against the root's three turns. Both: the
    response of a link and all below it.
    """
    turned = rooted(pin(root.parts), turns, pin)
    pushed = pin(force.parts)
    head = rooted(pushed, turns, pin)
    rows = [jnp.zeros((k + 1, turns.shape[-1]), turns.dtype) for k in range(3)]
    rows += [turned[j, : 4 + j] for j in range(3)]
    for j in range(1, tree.links):
        own = total([f[j] * part[1 : j + 1] for f, part in zip(pushed, freedom.parts, strict=True)])
        rows.append(pin(jnp.concatenate([head[j], own * tree.above[j, 1 : j + 1]])))
    return rows


def _root(turns: jax.Array) -> Motion:
    """Root's three unit turns; components [3, L]."""
    spin = tuple(turns[:, c] for c in range(3))
    none = jnp.zeros_like(spin[0])
    return Motion((spin[0], spin[1], spin[2]), (none, none, none))
