"""Sloping or slippery floors in place of that of evolution.

Each function returns the creature with another model. Its parts, their masses and all indices stay
the same, so `simulate` accepts it with every champion of the creature. Uneven ground is set by the
creature's `terrain`: `creature.on("rough:0.05")`.
"""

import copy
import dataclasses

import numpy as np

from mjxgait.creature import Creature


def sloping(creature: Creature, angle: float) -> Creature:
    """Return the creature on ground that rises forward by `angle` rad; a negative angle descends.

    Gravity is tilted, not the floor: heights are perpendicular to the slope, and the balance
    correction takes the slope for level.
    """
    model = copy.copy(creature.model)
    forward = (creature.frame.stand_rot @ creature.frame.forward) * [1.0, 1.0, 0.0]
    forward /= np.linalg.norm(forward)
    model.opt.gravity[:] = model.opt.gravity[2] * (
        np.sin(angle) * forward + [0.0, 0.0, np.cos(angle)]
    )
    return dataclasses.replace(creature, model=model)


def slippery(creature: Creature, friction: float) -> Creature:
    """Return the creature with this coefficient of sliding friction at every contact."""
    model = copy.copy(creature.model)
    model.geom_friction[:, 0] = friction
    return dataclasses.replace(creature, model=model)
