"""Dynamics of trees as data: mass matrix, bias forces, water, overlap (see `lane_major.dynamics`).

Letters: `n` links, `L` lanes.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp

from mjxgait.physics.batched_trees.tree import (
    FAR,
    Tree,
    centres,
    down,
    frames,
    hinges,
    root_motion,
    up,
)
from mjxgait.physics.derived import inverse_weights
from mjxgait.physics.lane_major.dynamics import (
    Inertia,
    force_cross,
    motion_cross,
    pack,
    rooted,
    unpack,
)
from mjxgait.physics.lane_major.kinematics import Motion, Pose
from mjxgait.physics.lane_major.lanes import (
    Pin,
    cross,
    dot,
    parts,
    plus,
    scale,
    total,
    turn_each,
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
    gravity: float | jax.Array,
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


def weighed(tree: Tree) -> Tree:
    """Return one body, arrays without lanes, with the weights of its blocks and hinges.

    It runs once per body, so its loops are not unrolled: that would take the compiler longer than
    the rest of a body's growth.
    """
    links = tree.links
    rot, pos = _at_rest(tree)
    axis = rot[:, 2] * tree.moves[:, None]
    centre = pos + jnp.einsum("li,lij->lj", tree.com, rot, precision="highest")
    centre = centre * tree.solid[:, None]
    spin = jnp.concatenate([jnp.zeros((3, 3)), jnp.eye(3), axis[1:]])
    shift = jnp.concatenate([jnp.eye(3), jnp.zeros((3, 3)), jnp.cross(pos, axis)[1:]])
    moves = jnp.concatenate([jnp.ones((links, 6)), tree.above[:, 1:]], axis=1)[:, :, None]
    slides = (shift + jnp.cross(spin, centre[:, None])) * moves
    turns = jnp.broadcast_to(spin, slides.shape) * moves
    own = jnp.einsum("ldj,lki,lij->ldk", turns, tree.axes, rot, precision="highest")
    still = jnp.concatenate([jnp.zeros(6), (tree.armature + 1 - tree.moves)[1:]])
    mass = (
        jnp.einsum("ldj,l,lej->de", slides, tree.mass, slides, precision="highest")
        + jnp.einsum("ldk,lk,lek->de", own, tree.inertia, own, precision="highest")
        + jnp.diag(still)
    )
    body_weight, dof = inverse_weights(
        mass,
        jnp.swapaxes(jnp.concatenate([slides, turns], axis=2), 1, 2),
        [range(3), range(3, 6), *([j] for j in range(6, 5 + links))],
    )
    return dataclasses.replace(
        tree, body_weight=body_weight[:, 0], dof_weight=jnp.concatenate([jnp.zeros(1), dof[6:]])
    )


def _at_rest(tree: Tree) -> tuple[jax.Array, jax.Array]:
    """Return axes [n, 3, 3] (rows) and places [n, 3] of all links with all angles 0."""
    root = jnp.concatenate([jnp.eye(3), jnp.zeros((1, 3))])  # axes, then the place

    def placed(known: jax.Array, link: jax.Array) -> tuple[jax.Array, None]:
        above = jnp.einsum("a,aij->ij", tree.parent[link], known, precision="highest")
        steps = jnp.concatenate([tree.turn[link], tree.place[link][None]])
        own = jnp.matmul(steps, above[:3], precision="highest").at[3].add(above[3])
        return jnp.where((jnp.arange(tree.links) == link)[:, None, None], own, known), None

    none = jnp.zeros((tree.links - 1, 4, 3))
    known, _ = jax.lax.scan(placed, jnp.concatenate([root[None], none]), jnp.arange(1, tree.links))
    return known[:, :3], known[:, 3]


def drag_links(
    tree: Tree,
    poses: Sequence[Pose],
    body: Inertia,
    moving: jax.Array,
    drag: float | jax.Array,
    pin: Pin,
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


def deepest(tree: Tree, poses: Sequence[Pose]) -> jax.Array:
    """Largest depth [L] as a share of the smaller block's size; negative if all are apart.

    The size of a block is the cube root of its volume.

    Two blocks are apart if one of their six normals separates them. Blocks that only a line along
    two edges would separate count as overlapping: the depth is never less than the least way out.
    Of blocks with a single joint between them, only the depth of the outer one's far end in the
    other counts.
    """
    rot, centre = frames(poses), centres(tree, poses)
    normals = [turn_each(rot, tree.axes[:, k]) for k in range(3)]
    apart = [c[:, None] - c[None] for c in centre]
    size = sizes(tree)
    least = jnp.minimum(size[:, None], size[None])
    along = []
    for k, normal in enumerate(normals):
        own = [x[:, None] for x in normal]
        reach = [abs(dot(own, [x[None] for x in other])) for other in normals]
        other = dot(reach, [tree.half[None, :, j] for j in range(3)])
        along.append(tree.half[:, None, k] + other - abs(dot(own, apart)))
    depth = jnp.minimum(jnp.minimum(along[0], along[1]), along[2])
    depth = jnp.minimum(depth, jnp.swapaxes(depth, 0, 1))
    ends = [2 * c - x for c, x in zip(centre, hinges(poses), strict=True)]
    beyond = [end[:, None] - c[None] for end, c in zip(ends, centre, strict=True)]
    into = [
        tree.half[None, :, k] - abs(dot([x[None] for x in normal], beyond))
        for k, normal in enumerate(normals)
    ]
    end = jnp.minimum(jnp.minimum(into[0], into[1]), into[2])
    joints, both = joints_between(tree), tree.solid[:, None] * tree.solid[None] > 0
    within = jnp.where(both & (joints > 1), depth, -FAR)
    joined = both & (joints == 1) & (tree.above > 0)
    return jnp.max(jnp.where(joined, end, within) / least, axis=(0, 1))


def sizes(tree: Tree) -> jax.Array:
    """Cube root [n, L] m of each block's volume."""
    return 2 * jnp.cbrt(tree.half[:, 0] * tree.half[:, 1] * tree.half[:, 2])


def joints_between(tree: Tree) -> jax.Array:
    """Return the number of joints between two blocks, [n, n, L]."""
    joint = tree.solid * tree.moves
    between = abs(tree.above[:, None] - tree.above[None])
    return jnp.sum(between * joint, axis=2)
