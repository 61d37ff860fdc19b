"""Heights are measured above the ground: climbing is neither a fall nor a jump."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from mjxgait.controllers.observations import sense
from mjxgait.creature import Creature
from mjxgait.tasks.falls import Reason, why_fallen
from mjxgait.types import Sensed


def standing(creature: Creature, above: float, floor: float | None) -> Sensed:
    """The creature in its start pose, `above` m higher."""
    nothing, count = jnp.zeros(3), len(creature.joints.names)
    return Sensed(
        joint_pos=jnp.asarray(creature.joints.stand),
        joint_vel=jnp.zeros(count),
        bias=jnp.zeros(creature.model.nv),
        trunk_pos=jnp.asarray(creature.frame.stand_pos + np.array([0.0, 0.0, above])),
        trunk_rot=jnp.asarray(creature.frame.stand_rot),
        trunk_vel=nothing,
        trunk_angvel=nothing,
        geom_pos=jnp.zeros((len(creature.feet.watched), 3)),
        geom_low=jnp.full(len(creature.feet.watched), 0.01),
        floor=None if floor is None else jnp.float32(floor),
    )


def test_termination_uses_the_height_above_the_ground(stool: Creature):
    ends = stool.settings.termination
    assert why_fallen(stool, ends, standing(stool, 2.0, 2.0)) == Reason.FINISHED
    assert why_fallen(stool, ends, standing(stool, 2.0, None)) == Reason.TOO_HIGH
    assert why_fallen(stool, ends, standing(stool, 2.0, 2.2)) == Reason.TOO_LOW


def test_the_trunk_height_observation_is_above_the_ground(stool: Creature):
    moment = standing(stool, 2.0, 1.9)
    found = sense(stool, moment, jnp.float32(0), ["trunk_height"])["trunk_height"]
    np.testing.assert_allclose(found, stool.frame.stand_height + 0.1, atol=1e-5)
    level = dataclasses.replace(moment, floor=None)
    above = sense(stool, level, jnp.float32(0), ["trunk_height"])["trunk_height"]
    np.testing.assert_allclose(above, stool.frame.stand_height + 2.0, atol=1e-5)
