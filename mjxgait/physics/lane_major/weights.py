"""Inverse masses (`physics.weights`) from the lane-major physics' numbers."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.lane_major.dynamics import inertias, mass_rows, motion_paths
from mjxgait.physics.lane_major.kinematics import motions, posture
from mjxgait.physics.lane_major.lanes import pinned_by
from mjxgait.physics.lane_major.parameters import Parameters
from mjxgait.physics.lane_major.slots import BALL, FREE, FREEDOMS
from mjxgait.physics.lane_major.structure import Structure, join, scalars
from mjxgait.physics.lane_major.topology import Topology
from mjxgait.physics.weights import inverse_weights, weight_groups


def reweighed(topology: Topology, parameters: Parameters) -> Parameters:
    """Recompute the weights of one body's contacts and limits."""
    numbers = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), parameters)
    structure = join(topology, numbers, np.dtype(np.float32))
    groups = weight_groups([joint.kind for joint in topology.joints])
    body, dof = inverse_weights(*_at_rest(structure), groups)
    carried = np.array([contact.body for contact in topology.contacts], int)
    limited = np.array([limit.dof for limit in topology.limits], int)
    return dataclasses.replace(
        numbers,
        contacts=dataclasses.replace(numbers.contacts, weight=body[carried, 0]),
        limits=dataclasses.replace(numbers.limits, weight=dof[limited]),
    )


def _at_rest(structure: Structure) -> tuple[jax.Array, jax.Array]:
    """Mass matrix [nv, nv] and centres' Jacobian [B, 6, nv] of one lane at rest."""
    topology, like = structure.topology, jnp.ones(1, jnp.float32)
    pin = pinned_by(like)
    poses, freedoms = posture(structure, _rest(structure), pin)
    freedom = motions(freedoms, like, pin)
    paths = motion_paths(structure, freedom, pin)
    rows = mass_rows(structure, inertias(structure.columns, poses, like, pin), freedom, paths, pin)
    lower = jnp.zeros((len(rows), len(rows)), like.dtype)
    for k, chain in enumerate(topology.pattern.chains):
        lower = lower.at[k, np.array(chain)].set(rows[k][:, 0])
    spin, shift = (jnp.stack([x[:, 0] for x in v], axis=1) for v in (freedom.spin, freedom.shift))
    centres = jnp.stack(
        [
            jnp.broadcast_to(pose.point(scalars(com)), (3, 1))[:, 0]
            for pose, com in zip(poses, structure.exact.com, strict=True)
        ]
    )
    moved = shift + jnp.cross(spin, centres[:, None])
    jacobian = jnp.concatenate([moved, jnp.broadcast_to(spin, moved.shape)], axis=2)
    jacobian = jnp.where(_moves(topology)[:, :, None], jacobian, 0.0)
    return lower + jnp.tril(lower, -1).T, jnp.swapaxes(jacobian, 1, 2)


def _rest(structure: Structure) -> jax.Array:
    """MuJoCo's qpos0 [nq, 1], with free roots at the origin, which leaves the weights unchanged."""
    rest = []
    for joint in (joint for body in structure.bodies for joint in body.joints):
        if joint.kind == FREE:
            rest += [0.0] * 3
        turns = joint.kind in (FREE, BALL)
        rest += [1.0, 0.0, 0.0, 0.0] if turns else [joint.reference]
    return jnp.stack([jnp.broadcast_to(value, 1) for value in rest]).astype(jnp.float32)


def _moves(topology: Topology) -> np.ndarray:
    """[B, nv]: True if a degree of freedom moves a body."""
    moves = np.zeros((len(topology.bodies), len(topology.dof_parent)), bool)
    for b, body in enumerate(topology.bodies):
        if body.parent >= 0:
            moves[b] = moves[body.parent]
        for joint in body.joints:
            moves[b, joint.dof : joint.dof + FREEDOMS[joint.kind]] = True
    return moves
