"""With what joints a body steps under a fall."""

import mujoco
import numpy as np

from mjxgait.creature import geometry
from mjxgait.creature.anatomy import Stepping
from mjxgait.errors import UserError


def stepping_of(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    ahead: np.ndarray,
    aside: np.ndarray,
    joints: list[int],
    feet: tuple[list[int], list[int]],
    trunk: tuple[int, np.ndarray],
) -> Stepping | None:
    """What the weights [J] say of a body in its standing pose; None where all are zero.

    Args:
      joints: [J] ids. feet: bodies of the feet, and all their geoms. trunk: its body, and the axis
        [3] in its frame that points forward.

    Raises:
      UserError: names a joint that has a weight and moves no foot, or several.
    """
    if not (ahead.any() or aside.any()):
        return None
    bodies, geoms = feet
    chains = [geometry.ancestors(model, body) for body in bodies]
    legs = []
    for joint, weighs in zip(joints, (ahead != 0) | (aside != 0), strict=True):
        moved = [f for f, chain in enumerate(chains) if int(model.jnt_bodyid[joint]) in chain]
        if weighs and len(moved) != 1:
            raise UserError(
                f'stepping: joint "{model.joint(joint).name}" moves {len(moved)} feet; give weights '
                "to joints that move one"
            )
        legs.append(moved[0] if moved else 0)
    body, forward = trunk
    nose = data.xmat[body].reshape(3, 3) @ forward * [1, 1, 0]
    nose = nose / np.linalg.norm(nose)
    frame = np.stack([nose, np.cross([0, 0, 1], nose)], 1)
    own = [[g for g in geoms if model.geom_bodyid[g] == foot] for foot in bodies]
    places = [(data.geom_xpos[one].mean(0) - data.xpos[body]) @ frame for one in own]
    return Stepping(ahead, aside, np.array(places), tuple(legs))
