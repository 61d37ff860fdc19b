"""Scaled parts: lengths, masses and inertias follow, and the files stay the same."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from mjxgait.api import load_creature
from mjxgait.creature import Creature
from mjxgait.creature.scale import at_step, parse_scales, scaled
from mjxgait.errors import UserError


def test_a_whole_creature_scales_by_geometry(shipped: Creature):
    """Length scales with s, mass with s³, inertia with s⁵."""
    big, s = scaled(shipped, {"*": 1.2}), 1.2
    mine, its = shipped.model, big.model
    assert np.allclose(its.body_mass, s**3 * mine.body_mass)
    assert np.allclose(its.body_inertia, s**5 * mine.body_inertia, rtol=1e-4)
    assert big.frame.hip_height == pytest.approx(s * shipped.frame.hip_height, rel=1e-3)
    assert big.frame.body_length == pytest.approx(s * shipped.frame.body_length, rel=1e-3)
    assert np.allclose(its.body_pos[2:], s * mine.body_pos[2:], atol=1e-6)
    assert np.array_equal(big.gains.kp, shipped.gains.kp)
    assert big.digest != shipped.digest


def test_only_matching_parts_change():
    dog = load_creature("tall_quadruped")
    longer = scaled(dog, {"*_lower": 1.3})
    for name in (dog.model.body(b).name for b in range(1, dog.model.nbody)):
        factor = 1.3**3 if name.endswith("_lower") else 1.0
        its = longer.model.body(name).mass[0]
        assert its == pytest.approx(factor * dog.model.body(name).mass[0], rel=1e-5), name
    assert longer.frame.hip_height > dog.frame.hip_height


def test_a_scaled_creature_still_stands_on_its_feet(stool: Creature):
    tall = scaled(stool, {"*_left": 1.5, "*_right": 1.5})
    for creature in (stool, tall):
        data = mujoco.MjData(creature.model)
        data.qpos[:] = creature.stand_qpos
        mujoco.mj_kinematics(creature.model, data)
        feet = creature.feet.watched[:4]
        low = data.geom_xpos[feet, 2] - creature.model.geom_size[feet, 0]
        assert np.allclose(low, low[0], atol=1e-9)
        assert low[0] == pytest.approx(0.0, abs=2e-3)
    assert tall.frame.hip_height == pytest.approx(1.5 * stool.frame.hip_height, rel=0.02)


def test_patterns_multiply_and_no_pattern_changes_nothing(stool: Creature):
    twice = scaled(stool, {"*": 1.1, "trunk": 2.0})
    assert twice.model.body("trunk").mass == pytest.approx(
        2.2**3 * stool.model.body("trunk").mass, rel=1e-5
    )
    assert scaled(stool, {}) is stool


def test_a_run_keeps_the_scaled_body(tmp_path: Path, stool: Creature):
    from mjxgait.config.schema import Config
    from mjxgait.training.folder import create_run, open_run

    tall = scaled(stool, {"front_*": 1.2, "hind_*": 1.2})
    create_run(tmp_path / "run", tall, Config())
    kept, _ = open_run(tmp_path / "run")
    assert kept.digest == tall.digest
    assert np.array_equal(kept.model.body_mass, tall.model.body_mass)


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["shin"], "give PATTERN=FACTOR"),
        (["shin=long"], "give PATTERN=FACTOR"),
        (["=1.2"], "give PATTERN=FACTOR"),
        (["shin=0"], "from 0.2 to 5"),
        (["shin=nan"], "from 0.2 to 5"),
        (["front_lef=1.2"], 'no part matches "front_lef"; did you mean "front_left"'),
    ],
)
def test_a_mistake_is_reported_in_one_sentence(stool: Creature, texts: list[str], words: str):
    with pytest.raises(UserError, match=words):
        scaled(stool, parse_scales(texts))


def test_scaling_a_mesh_is_rejected(stool: Creature):
    """Its vertices belong to an asset that other parts may share."""
    mesh = '<mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
    xml = stool.files["creature.xml"]
    xml = xml.replace("<worldbody>", f"<asset>{mesh}</asset><worldbody>", 1)
    shape = '<geom name="extra" type="mesh" mesh="m" mass="0.1" contype="0" conaffinity="0"/>'
    xml = xml.replace('<geom name="plate"', f'{shape}<geom name="plate"', 1)
    from mjxgait.creature.scale import scaled_files

    with pytest.raises(UserError, match='part "trunk" has the mesh "m"'):
        scaled_files({**stool.files, "creature.xml": xml}, {"trunk": 1.2})


def test_a_flat_part_can_be_read_again(stool: Creature):
    """Two moments of a flat part are the third together, and MuJoCo writes six digits of each."""
    flat = (
        '<inertial pos="0 0 0" mass="1" diaginertia="0.00033333333 0.00033333333 0.00066666666"/>'
    )
    xml = stool.files["creature.xml"].replace("<freejoint", f"{flat}<freejoint", 1)
    assert flat in xml
    slow = at_step(replace(stool, files={**stool.files, "creature.xml": xml}), 0.004)
    assert slow.model.body_inertia[1] == pytest.approx([1 / 3000, 1 / 3000, 2 / 3000], rel=1e-4)


def test_the_api_scales_too(stool: Creature):
    from helpers import STOOL

    assert load_creature(STOOL, {"*": 0.8}).frame.mass == pytest.approx(0.8**3 * stool.frame.mass)
