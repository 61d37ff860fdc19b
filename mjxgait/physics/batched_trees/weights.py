"""Inverse masses that constraints see, for a tree at rest."""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.physics.batched_trees.dynamics import mass_rows
from mjxgait.physics.batched_trees.motion import motions, posture, root_turns
from mjxgait.physics.batched_trees.tree import Tree
from mjxgait.physics.lane_major.dynamics import inertias
from mjxgait.physics.lane_major.lanes import pinned_by
from mjxgait.physics.weights import inverse_weights


def weighed(tree: Tree) -> Tree:
    """Return one body, arrays without lanes, with the weights of its blocks and hinges."""
    lane = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32)[..., None], tree)
    links, like = tree.links, jnp.ones(1, jnp.float32)
    rest = jnp.zeros((links + 6, 1), jnp.float32).at[3].set(1.0)
    pin = pinned_by(like)
    poses = posture(lane, rest, pin)
    freedom, turns = motions(lane, poses, pin), root_turns(poses)
    body = inertias(lane, poses, like, pin)
    rows = mass_rows(lane, turns, freedom, body, pin)
    lower = jnp.stack([jnp.pad(row[:, 0], (0, len(rows) - len(row))) for row in rows])
    mass = lower + jnp.tril(lower, -1).T
    solid = jnp.where(lane.solid > 0, lane.mass, 1.0)[:, 0]
    centre = jnp.stack([h[:, 0] for h in body.moment], axis=1) / solid[:, None]
    spin = jnp.concatenate([jnp.zeros((3, 3)), jnp.eye(3), jnp.stack(freedom.spin)[:, 1:, 0].T])
    shift = jnp.concatenate([jnp.eye(3), jnp.zeros((3, 3)), jnp.stack(freedom.shift)[:, 1:, 0].T])
    moves = jnp.concatenate([jnp.ones((links, 6)), tree.above[:, 1:]], axis=1)[:, :, None]
    at_centre = (shift + jnp.cross(spin, centre[:, None])) * moves
    jacobian = jnp.concatenate([at_centre, jnp.broadcast_to(spin, at_centre.shape) * moves], axis=2)
    body_weight, dof = inverse_weights(
        mass,
        jnp.swapaxes(jacobian, 1, 2),
        [range(3), range(3, 6), *([j] for j in range(6, 5 + links))],
    )
    still = jnp.zeros(1)
    return dataclasses.replace(
        tree, body_weight=body_weight[:, 0], dof_weight=jnp.concatenate([still, dof[6:]])
    )
