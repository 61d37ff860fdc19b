"""Where a touch does not end the episode, the whole body collides with the floor."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import STOOL

from mjxgait.creature import Creature, load_creature
from mjxgait.physics import make_plant
from mjxgait.physics.lane_major import LaneMajorPlant
from mjxgait.types import BodyState

SECONDS = 1.0
SLIM = {"xla_backend_optimization_level": 0}
"""Most of the time here is compilation."""


@pytest.fixture(scope="module")
def round_stool(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    """The stool with a capsule as plate (lane-major physics has no boxes) and no leg contacts."""
    folder = tmp_path_factory.mktemp("round")
    for name in ("creature.toml", "creature.xml"):
        text = (STOOL / name).read_text()
        plate = 'type="box" size="0.25 0.12 0.04"'
        assert name == "creature.toml" or plate in text
        text = text.replace('_leg" type', '_leg" contype="0" conaffinity="0" type')
        text = text.replace(plate, 'type="capsule" fromto="-0.2 0 0 0.2 0 0" size="0.04"')
        (folder / name).write_text(text)
    return load_creature(Path(folder))


def on_its_back(creature: Creature) -> BodyState:
    still = jnp.zeros((creature.model.nv, 1), jnp.float32)
    qpos = np.array(creature.stand_qpos)
    qpos[2], qpos[3:7] = 0.06, [0, 1, 0, 0]
    return BodyState(
        jnp.asarray(qpos, jnp.float32)[:, None], still, still, still, jnp.ones((1,), jnp.float32)
    )


def lowest_after(creature: Creature, touch_ends: bool) -> float:
    """Height in m of the lowest part, one second after the limp creature is put on its back."""
    plant, _ = make_plant(creature, "auto", touch_ends)
    assert isinstance(plant, LaneMajorPlant)
    limp = jnp.zeros((creature.model.nv, 1), jnp.float32)

    def step(state: BodyState) -> tuple[jax.Array, BodyState]:
        sensed, step_data = plant.forward(state)
        return jnp.min(sensed.geom_low), plant.advance(state, step_data, limp)

    state = on_its_back(creature)
    program = jax.jit(step).lower(state).compile(compiler_options=SLIM)
    for _ in range(round(SECONDS / creature.model.opt.timestep)):
        low, state = program(state)
    return float(low)


def test_a_creature_on_its_back_rests_on_the_floor(round_stool: Creature):
    assert lowest_after(round_stool, touch_ends=False) > -0.01


def test_only_feet_have_contacts_where_a_touch_ends_the_episode(round_stool: Creature):
    """Contacts cost time, and after the end the motion does not matter."""
    feet, whole = (
        len(make_plant(round_stool, "auto", touch_ends)[0].structure.contacts)
        for touch_ends in (True, False)
    )
    assert (feet, whole) == (4, 4 + 2)
