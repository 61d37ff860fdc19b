"""The joints with which a body steps under a fall."""

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.anatomy import Stepping
from mjxgait.errors import UserError


def stepping_of(
    model: mujoco.MjModel,
    ahead: np.ndarray,
    aside: np.ndarray,
    turn: np.ndarray,
    joints: list[int],
    feet: list[int],
) -> Stepping | None:
    """Stepping of a body with these weights [J]; None where all are zero.

    Args:
      joints: [J] ids. feet: bodies of the feet.

    Raises:
      UserError: names a joint that has a weight and moves no foot, or several.
    """
    weights = (ahead != 0) | (aside != 0) | (turn != 0)
    if not weights.any():
        return None
    chains = [geometry.ancestors(model, body) for body in feet]
    legs = []
    for joint, weighs in zip(joints, weights, strict=True):
        moved = [f for f, chain in enumerate(chains) if int(model.jnt_bodyid[joint]) in chain]
        if weighs and len(moved) != 1:
            raise UserError(
                f'stepping: joint "{model.joint(joint).name}" moves {len(moved)} feet; give weights '
                "to joints that move one"
            )
        legs.append(moved[0] if moved else 0)
    return Stepping(ahead, aside, turn, tuple(legs))
