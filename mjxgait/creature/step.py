"""A body with another simulation time step."""

import mujoco

from mjxgait.creature.creature import Creature
from mjxgait.creature.scale import MODEL, SIZE, load_files


def at_step(creature: Creature, step: float) -> Creature:
    """Return the creature with a time step in s; 0 keeps its own."""
    if step in (0.0, float(creature.model.opt.timestep)):
        return creature
    spec = mujoco.MjSpec.from_string(creature.files[MODEL])
    spec.option.timestep = step
    return load_files({**creature.files, MODEL: SIZE.sub("", spec.to_xml())})
