"""Places of a creature's bars (mjxgait/creature/overlap.py), lanes innermost."""

from collections.abc import Sequence
from typing import Any

import jax

from mjxgait.physics.lane_major.kinematics import Pose, posture
from mjxgait.physics.lane_major.lanes import pinned_by, table, turn
from mjxgait.physics.lane_major.structure import Structure, scalars
from mjxgait.physics.overlap import single, whole


def bar_places(
    structure: Structure, qpos: jax.Array, like: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Each bar's middle, from its tree's origin, and from there to one end: [S, 3, L] m.

    Args:
      qpos: [nq, L]. like: any finite [L].
    """
    poses, _ = posture(structure, qpos, pinned_by(like))
    if structure.topology.open_pairs:
        return _looked_up(structure, poses, like)
    bodies = [poses[body] for body in structure.topology.bar_body]
    bars = structure.exact.bars
    middles = zip(bodies, scalars(bars.centre), strict=True)
    ends = zip(bodies, scalars(bars.half), strict=True)
    return (
        table([pose.point(local) for pose, local in middles], like),
        table([turn(pose.rot, local) for pose, local in ends], like),
    )


def _looked_up(
    structure: Structure, poses: Sequence[Pose], like: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Look up the places of bars with body indices that are numbers of the program."""
    bars = structure.exact.bars
    assert bars.body is not None
    body = whole(bars.body[..., 0])
    places = table([pose.pos for pose in poses], like)[body]
    axes = [table([pose.rot[j] for pose in poses], like)[body] for j in range(3)]

    def turned(local: Any) -> jax.Array:
        x, y, z = (single(local[:, j, None]) for j in range(3))
        return axes[0] * x + axes[1] * y + axes[2] * z

    return places + turned(bars.centre), turned(bars.half)
