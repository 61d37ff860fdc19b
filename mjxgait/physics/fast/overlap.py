"""Where the bars of a creature are (mjxgait/creature/overlap.py), lanes innermost."""

import jax

from mjxgait.creature.overlap import Crossings
from mjxgait.physics.fast.kinematics import posture
from mjxgait.physics.fast.lanes import constants, pinned_by, table, turn
from mjxgait.physics.fast.structure import Structure


def bar_places(
    structure: Structure, crossings: Crossings, qpos: jax.Array, like: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Middle of each bar, from its tree's origin, and from there to one end: both [S, 3, L] m.

    Args:
      qpos: [nq, L]. like: any finite [L].
    """
    poses, _ = posture(structure, qpos, pinned_by(like))
    bodies = [poses[body - 1] for body in crossings.body]
    middles = zip(bodies, constants(crossings.centre), strict=True)
    ends = zip(bodies, constants(crossings.half), strict=True)
    return (
        table([pose.point(local) for pose, local in middles], like),
        table([turn(pose.rot, local) for pose, local in ends], like),
    )
