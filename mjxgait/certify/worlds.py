"""Other ground to walk on than that of evolution: uneven, sloping or slippery.

Each function gives back the creature with another model. Its parts, their masses and all indices
stay the same, so `simulate` takes it with every champion of the creature. What the examiner reads
of heights takes the floor for level: on uneven ground it cannot tell a touch.
"""

import copy
import dataclasses

import mujoco
import numpy as np

from mjxgait.creature import Creature

FLOOR = "floor"
THICKNESS = 1.0
"""Of the uneven ground in m, more than anything sinks in."""


def uneven(
    creature: Creature, amplitude: float, rng: np.random.Generator, reach: float = 40.0
) -> Creature:
    """The floor as a height field around the start, `reach` m to each side.

    At the corners of a grid of half a hip height the heights are uniform in ±`amplitude` m;
    triangles join them. The start is level: the bumps begin a body length away and have their full
    height from two body lengths on.
    """
    spec = mujoco.MjSpec.from_string(creature.files["creature.xml"])
    side = 2 * round(2 * reach / creature.hip_height) + 1
    # The compiler stretches heights to the full range, so they are set afterwards.
    spec.add_hfield(
        name="bumps",
        nrow=side,
        ncol=side,
        size=[reach, reach, 2 * amplitude, THICKNESS],
        userdata=np.zeros(side**2),
    )
    floor = spec.geom(FLOOR)
    floor.type, floor.hfieldname = mujoco.mjtGeom.mjGEOM_HFIELD, "bumps"
    floor.pos = floor.pos + np.array([*creature.stand_pos[:2], -amplitude])
    model = spec.compile()
    far = np.linspace(-reach, reach, side)
    away = np.hypot(far[:, None], far) / creature.body_length
    bumps = rng.uniform(-1, 1, (side, side)) * np.clip(away - 1, 0, 1)
    model.hfield_data[:] = (bumps.ravel() + 1) / 2
    return dataclasses.replace(creature, model=model)


def sloping(creature: Creature, angle: float) -> Creature:
    """Ground that rises forward by `angle` rad; negative falls.

    Gravity is tilted and not the floor: heights are square to the slope, and the balance correction
    takes the slope for level.
    """
    model = copy.copy(creature.model)
    forward = (creature.stand_rot @ creature.forward) * [1.0, 1.0, 0.0]
    forward /= np.linalg.norm(forward)
    model.opt.gravity[:] = model.opt.gravity[2] * (
        np.sin(angle) * forward + [0.0, 0.0, np.cos(angle)]
    )
    return dataclasses.replace(creature, model=model)


def slippery(creature: Creature, friction: float) -> Creature:
    """Every contact with this coefficient of sliding friction."""
    model = copy.copy(creature.model)
    model.geom_friction[:, 0] = friction
    return dataclasses.replace(creature, model=model)
