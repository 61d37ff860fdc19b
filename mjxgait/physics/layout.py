"""Which parts of a model are sensed."""

import dataclasses

import numpy as np

from mjxgait.creature import Creature


@dataclasses.dataclass(frozen=True, eq=False)
class SenseLayout:
    """What is sensed.

    trunk: body id. qpos_adr, dof_adr: [J] addresses of the actuated joints. watched: [G] geom ids, of which the
    first `feet` are feet.
    """

    trunk: int
    qpos_adr: np.ndarray
    dof_adr: np.ndarray
    watched: np.ndarray
    feet: int = 0


class OtherTopology(Exception):
    """A body does not fit a plant made for another; the message says in what."""


def sense_layout(creature: Creature) -> SenseLayout:
    """The layout of a creature."""
    return SenseLayout(
        creature.trunk,
        creature.joints.qpos_adr,
        creature.joints.dof_adr,
        creature.feet.watched,
        len(creature.feet.foot_of),
    )
