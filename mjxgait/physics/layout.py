"""Parts of a model that are sensed."""

import dataclasses

import numpy as np

from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True, eq=False)
class SenseLayout:
    """Parts of a model that are sensed.

    trunk: body id. qpos_adr, dof_adr: [J] addresses of the actuated joints.
    watched: [G] geom ids; the first `feet` of them are feet.
    """

    trunk: int
    qpos_adr: np.ndarray
    dof_adr: np.ndarray
    watched: np.ndarray
    feet: int = 0


class OtherTopology(Exception):
    """Error for a body that does not fit a plant; the message says where they differ."""


def sense_layout(creature: Creature) -> SenseLayout:
    """Layout of a creature."""
    return SenseLayout(
        creature.trunk,
        creature.joints.qpos_adr,
        creature.joints.dof_adr,
        creature.feet.watched,
        len(creature.feet.foot_of),
    )
