"""Bodies that fit a plant made for another body, and the messages for those that do not."""

import dataclasses
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from helpers import STOOL
from many_bodies import (
    XML,
    compiled,
    layout_of,
    stacked,
)

from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.physics import make_plant, parameters_of
from mjxgait.physics.lane_major.topology import read_topology
from mjxgait.types import BodyState


def stool_with(folder: Path, *changes: tuple[str, str]) -> Creature:
    """A stool with an edited model file."""
    folder.mkdir()
    for name in ("creature.toml", "creature.xml"):
        text = (STOOL / name).read_text()
        for old, new in changes if name.endswith("xml") else ():
            assert old in text
            text = text.replace(old, new)
        (folder / name).write_text(text)
    return load_creature(folder)


@pytest.fixture(scope="module")
def tall_stool(tmp_path_factory: pytest.TempPathFactory) -> Creature:
    """A stool with legs a fifth longer and thicker feet and plate."""
    return stool_with(
        tmp_path_factory.mktemp("tall") / "stool",
        ("0 0 0 0 0 -0.24", "0 0 0 0 0 -0.288"),
        ("0 0 -0.27", "0 0 -0.324"),
        ('size="0.03"', 'size="0.035"'),
        ("0.25 0.12 0.04", "0.25 0.12 0.05"),
        ("0 0 0.299", "0 0 0.358"),
    )


@pytest.fixture(scope="module")
def plants(stool: Creature) -> dict[str, Any]:
    return {physics: make_plant(stool, physics, True)[0] for physics in SAID}


HIP = '<joint name="hind_left_hip"/>'
FOOT = '<geom name="hind_left_foot" type="sphere" pos="0 0 -0.27" size="0.03"/>'
OTHERS = {
    "joints": ('_hip"/>', '_hip" type="slide"/>'),
    "contacts": (FOOT, FOOT.replace("sphere", "capsule").replace("0.03", "0.03 0.01")),
    "limits": (HIP, HIP.replace("/>", ' limited="true"/>')),
    "step": ('timestep="0.005"', 'timestep="0.004"'),
    "iterations": (' iterations="4"', ' iterations="5"'),
}
SAID = {
    "auto": {
        "joints": 'body "front_left" has the joints (slide), not (hinge)',
        "contacts": 'body "hind_left" touches the floor with 2 capsule ends, not 0',
        "limits": 'body "hind_left" has 1 joints with a limit, not 0',
        "step": "the timestep differs (0.004, not 0.005)",
        "iterations": "iterations differs (5, not 4)",
    },
    "mjx": {
        "joints": "its jnt_type differs",
        "contacts": "its geom_type differs",
        "limits": "its jnt_limited differs",
        "step": "its timestep differs",
        "iterations": "its iterations differs",
    },
}


@pytest.mark.parametrize("what", OTHERS)
def test_the_error_says_why_a_creature_needs_its_own_program(
    plants: dict[str, Any], what: str, tmp_path: Path
):
    other = stool_with(tmp_path / "other", OTHERS[what])
    for physics, plant in plants.items():
        with pytest.raises(UserError) as told:
            parameters_of(plant, other, True)
        assert str(told.value).startswith("stool needs a program of its own")
        assert str(told.value).endswith(f"another: {SAID[physics][what]}")


def test_names_are_not_part_of_a_topology():
    """Otherwise no second robot would ever fit."""
    model = mujoco.MjModel.from_xml_string(XML)
    renamed = mujoco.MjModel.from_xml_string(XML.replace('body name="', 'body name="other_'))
    own, other = (read_topology(each, layout_of(model), None) for each in (model, renamed))
    assert own.names != other.names
    assert own == other
    assert hash(own) == hash(other)


def lying(creature: Creature, bodies: int) -> BodyState:
    """States with lanes first; the hips are turned so that parts overlap."""
    model = creature.model
    qpos = np.tile(creature.stand_qpos, (bodies, 1))
    qpos[:, creature.joints.qpos_adr] = np.linspace(0.5, 0.6, bodies)[:, None] * (1, 1, -1, -1)
    still = np.zeros((bodies, model.nv))
    return BodyState(qpos, still, still, still, np.ones(bodies))


@pytest.mark.parametrize("physics", ["auto", "mjx"])
def test_overlap_is_computed_for_the_lanes_own_body(
    physics: str, plants: dict[str, Any], stool: Creature, tall_stool: Creature
):
    """The same as in a batch in which all lanes have this body."""
    plant = plants[physics]
    both = [parameters_of(plant, creature, True) for creature in (stool, tall_stool)]
    placed = [
        jax.tree.map(
            lambda x: jnp.moveaxis(jnp.asarray(x, jnp.float32), 0, plant.lane_axis),
            dataclasses.replace(lying(stool, 2), parameters=stacked(bodies)),
        )
        for bodies in (both, both[:1] * 2, both[1:] * 2)
    ]
    depths = compiled(plant.overlap, placed[0])
    together, *alone = [np.asarray(depths(state)) for state in placed]
    np.testing.assert_allclose(together, np.diagonal(alone), atol=1e-6)
    assert np.abs(alone[0] - alone[1]).min() > 1e-3


def test_a_longer_body_differs_only_in_parameters(plants: dict[str, Any], tall_stool: Creature):
    numbers = parameters_of(plants["auto"], tall_stool, True)
    assert numbers.contacts.radius == pytest.approx([0.035] * 4)
    assert numbers.contacts.center[:, 2] == pytest.approx([-0.324] * 4)
    own, _ = make_plant(tall_stool, "auto", True)
    for a, b in zip(jax.tree.leaves(numbers), jax.tree.leaves(own.parameters), strict=True):
        np.testing.assert_array_equal(a, b)
