"""Poses of the links and motions of their degrees of freedom, about the root's own place."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from mjxgait.physics.batched_trees.tree import FAR, Tree
from mjxgait.physics.lane_major.kinematics import Motion, Pose, unit_quaternion
from mjxgait.physics.lane_major.lanes import (
    Pin,
    Vector,
    axes,
    cross,
    parts,
    plus,
    rotation,
    sin_cos,
    total,
    turn,
    turn_each,
)


def posture(tree: Tree, qpos: jax.Array, pin: Pin) -> list[Pose]:
    """Forward kinematics of qpos [7 + n - 1, L]: pose of every link."""
    columns = [jnp.stack(column) for column in rotation(unit_quaternion(qpos[3:7]))]
    none = jnp.zeros_like(columns[0])
    known = [pin(jnp.concatenate([*columns, none]))]
    sines, cosines = sin_cos(qpos[7:])
    for link in range(1, tree.links):
        above = total([known[a] * tree.parent[link, a] for a in range(link)])
        rot, pos = [above[:3], above[3:6], above[6:9]], above[9:]
        x, y, z = (turn(rot, parts(tree.turn[link, axis])) for axis in range(3))
        sin, cos = sines[link - 1], cosines[link - 1]
        place = pos + turn(rot, parts(tree.place[link]))
        known.append(pin(jnp.concatenate([x * cos + y * sin, y * cos - x * sin, z, place])))
    origin = qpos[:3]
    return [Pose(origin, k[9:], (k[:3], k[3:6], k[6:9])) for k in known]


def motions(tree: Tree, poses: Sequence[Pose], pin: Pin) -> Motion:
    """Motion that each hinge at unit velocity gives its link and all below.

    Components [n, L]; zero for the root and for links that do not move.
    """
    axis = jnp.stack([pose.rot[2] for pose in poses]) * tree.moves[:, None]
    place = jnp.stack([pose.pos for pose in poses])
    shift = cross(axes(place), axes(axis))
    return Motion(axes(pin(axis)), pin(shift))


def frames(poses: Sequence[Pose]) -> list[jax.Array]:
    """Stack the three axes of all links, [n, 3, L] each; see `turn_each`."""
    return [jnp.stack([pose.rot[j] for pose in poses]) for j in range(3)]


def centres(tree: Tree, poses: Sequence[Pose]) -> Vector:
    """Centres of all blocks, components [n, L] m from the origin."""
    place = jnp.stack([pose.pos for pose in poses])
    return plus(axes(place), turn_each(frames(poses), tree.com))


def lows(tree: Tree, poses: Sequence[Pose]) -> jax.Array:
    """Height [n, L] m of each block's lowest point above z = 0; `FAR` of missing blocks."""
    rot = frames(poses)
    heights = [turn_each(rot, tree.axes[:, k])[2] for k in range(3)]
    reach = total([tree.half[:, k] * jnp.abs(height) for k, height in enumerate(heights)])
    middle = centres(tree, poses)[2] + poses[0].origin[2]
    return jnp.where(tree.solid > 0, middle - reach, FAR)


def root_turns(poses: Sequence[Pose]) -> jax.Array:
    """Axes [3, 3, L] about which the root turns."""
    return jnp.stack(poses[0].rot)


def down(tree: Tree, own: jax.Array, pin: Pin) -> jax.Array:
    """Sum own [n, c, L] over each link and all links above it: [c, L] per link."""
    return pin(
        jnp.stack(
            [
                total([own[a] * tree.above[link, a] for a in range(link + 1)])
                for link in range(tree.links)
            ]
        )
    )


def up(tree: Tree, own: jax.Array, pin: Pin) -> jax.Array:
    """Sum own [n, c, L] over each link and all links below it: [c, L] per link."""
    return pin(
        jnp.stack(
            [
                total([own[below] * tree.above[below, link] for below in range(link, tree.links)])
                for link in range(tree.links)
            ]
        )
    )


def root_motion(turns: jax.Array, vector: Sequence[jax.Array]) -> jax.Array:
    """Root's motion [6, L], angular first, from the first six of [nv] velocities."""
    spin = total([turns[j] * vector[3 + j] for j in range(3)])
    return jnp.concatenate([spin, jnp.stack(vector[:3])])
