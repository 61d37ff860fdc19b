"""Body facts of growing bodies for controllers, tasks and observations."""

import numpy as np

from mjxgait.creature.anatomy import (
    Corrections,
    Feet,
    Frame,
    Gains,
    Joints,
    Mirror,
)
from mjxgait.creature.body import GivenBody

AXES = np.eye(3, dtype=np.float32)


def anatomy(links: int) -> GivenBody:
    """Return the facts shared by all bodies with this many links.

    Every link but the root has a hinge, and every link's block is a foot.
    """
    hinges, none = links - 1, np.zeros(links - 1, np.float32)
    endless = np.full(hinges, np.inf, np.float32)
    frame = Frame(
        forward=AXES[0],
        left=AXES[1],
        up=AXES[2],
        stand_pos=np.zeros(3, np.float32),
        stand_rot=AXES,
        start_axes=(AXES[0], AXES[1]),
        hip_height=1.0,
        body_length=1.0,
        mass=1.0,
    )
    names = tuple(f"link{link}" for link in range(1, links))
    return GivenBody(
        frame=frame,
        joints=Joints(
            none,
            -endless,
            endless,
            -endless,
            endless,
            names=names,
            qpos=tuple(range(7, 7 + hinges)),
            dofs=tuple(range(6, 6 + hinges)),
        ),
        gains=Gains(none, none, endless),
        mirror=Mirror(none + 1, tuple(range(hinges)), False),
        corrections=Corrections(none, none, none, none),
        feet=Feet(("root", *names), tuple(range(links)), tuple(range(links)), ()),
        nv=6 + hinges,
    )
