"""Overlap depth of blocks that no joint connects.

Letters: `n` links, `L` lanes.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from mjxgait.physics.batched_trees.motion import centres, frames
from mjxgait.physics.batched_trees.tree import FAR, Tree
from mjxgait.physics.lane_major.kinematics import Pose
from mjxgait.physics.lane_major.lanes import dot, turn_each


def deepest(tree: Tree, poses: Sequence[Pose]) -> jax.Array:
    """Largest depth [L] as a share of the smaller block's size; negative if all are apart.

    The size of a block is the cube root of its volume.

    Two blocks are apart if one of their six normals separates them. Blocks that only a line along
    two edges would separate count as overlapping: the depth is never less than the least way out.
    """
    rot, centre = frames(poses), centres(tree, poses)
    normals = [turn_each(rot, tree.axes[:, k]) for k in range(3)]
    apart = [c[:, None] - c[None] for c in centre]
    along = []
    for k, normal in enumerate(normals):
        own = [x[:, None] for x in normal]
        reach = [abs(dot(own, [x[None] for x in other])) for other in normals]
        other = dot(reach, [tree.half[None, :, j] for j in range(3)])
        along.append(tree.half[:, None, k] + other - abs(dot(own, apart)))
    depth = jnp.minimum(jnp.minimum(along[0], along[1]), along[2])
    depth = jnp.minimum(depth, jnp.swapaxes(depth, 0, 1))
    size = sizes(tree)
    share = depth / jnp.minimum(size[:, None], size[None])
    return jnp.max(jnp.where(_counts(tree), share, -FAR), axis=(0, 1))


def sizes(tree: Tree) -> jax.Array:
    """Cube root [n, L] m of each block's volume."""
    return 2 * jnp.cbrt(tree.half[:, 0] * tree.half[:, 1] * tree.half[:, 2])


def _counts(tree: Tree) -> jax.Array:
    """Return the pairs [n, n, L] of blocks with two joints or more between them."""
    joint = tree.solid * tree.moves
    between = abs(tree.above[:, None] - tree.above[None])
    return (jnp.sum(between * joint, axis=2) > 1) & (tree.solid[:, None] * tree.solid[None] > 0)
