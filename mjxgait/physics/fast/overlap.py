"""Where the bars of a creature are (mjxgait/creature/overlap.py), lanes innermost."""

import jax

from mjxgait.physics.fast.kinematics import posture
from mjxgait.physics.fast.lanes import pinned_by, table, turn
from mjxgait.physics.fast.structure import Structure, scalars


def bar_places(
    structure: Structure, qpos: jax.Array, like: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Middle of each bar, from its tree's origin, and from there to one end: both [S, 3, L] m.

    Args:
      qpos: [nq, L]. like: any finite [L].
    """
    poses, _ = posture(structure, qpos, pinned_by(like))
    bodies = [poses[body] for body in structure.topology.bar_body]
    bars = structure.exact.bars
    middles = zip(bodies, scalars(bars.centre), strict=True)
    ends = zip(bodies, scalars(bars.half), strict=True)
    return (
        table([pose.point(local) for pose, local in middles], like),
        table([turn(pose.rot, local) for pose, local in ends], like),
    )
