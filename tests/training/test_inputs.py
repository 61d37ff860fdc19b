"""Body numbers as program inputs: another body of the same structure needs no compilation."""

import re
import shutil
from pathlib import Path

import jax
import numpy as np
import pytest
from helpers import STOOL, program_text, small_config

from mjxgait.creature import Creature, load_creature
from mjxgait.creature.overlap import find_crossings
from mjxgait.physics.derived import observation_layout
from mjxgait.physics.lane_major import lane_major_plant
from mjxgait.training.experiment import Batch, build_experiment
from mjxgait.training.simulator import BodyParams
from mjxgait.types import BodyState

INPUTS = {"body": "inputs", "physics": "auto"}


def changed(folder: Path, pattern: str, factor: float) -> Creature:
    """The folder's body, by default the stool, with the number in each match scaled."""
    if not folder.exists():
        shutil.copytree(STOOL, folder)
    for name in ("creature.xml", "creature.toml"):
        text = (folder / name).read_text()
        text = re.sub(pattern, lambda m: f"{m[1]}{float(m[2]) * factor:.6g}", text)
        (folder / name).write_text(text)
    return load_creature(folder)


SADDLE = """<geom name="saddle" type="box" size="0.05 0.04 0.01" pos="0 0 0.08" mass="0.1"/>"""


def saddled(folder: Path) -> Creature:
    """The folder's body with one more shape, which comes near other parts."""
    text = (folder / "creature.xml").read_text()
    trunk = re.search(r'<body name="trunk"[^>]*>', text)
    assert trunk
    (folder / "creature.xml").write_text(text.replace(trunk[0], trunk[0] + SADDLE))
    return load_creature(folder)


OTHERS = {
    "thicker, so heavier": (r'(size=")([\d.]+)', 1.1),
    "stiffer": (r"(kp = )([\d.]+)", 1.5),
    "weaker": (r"(torque_limit = )([\d.]+)", 0.5),
}


def program(creature: Creature, **rollout) -> str:
    batch = Batch((build_experiment(creature, small_config(rollout=rollout)),))
    return program_text(batch)


@pytest.fixture(scope="module")
def stools(stool) -> str:
    return program(stool, **INPUTS)


@pytest.mark.thorough("test_a_shape_more_needs_no_program_of_its_own has all changes at once")
@pytest.mark.parametrize("change", OTHERS)
def test_another_body_has_the_same_program(stools: str, change: str, tmp_path: Path):
    assert program(changed(tmp_path / "other", *OTHERS[change]), **INPUTS) == stools


def test_a_shape_more_needs_no_program_of_its_own(stools: str, stool: Creature, tmp_path: Path):
    """The program is padded for shapes that may touch the floor and pairs that may overlap, and
    body numbers are inputs.
    """
    for change in OTHERS.values():
        changed(tmp_path / "other", *change)
    other = saddled(tmp_path / "other")
    assert len(other.feet.watched) > len(stool.feet.watched)
    assert program(other, **INPUTS) == stools


def test_padding_does_not_change_results(tmp_path: Path):
    creature = saddled(shutil.copytree(STOOL, tmp_path / "other"))
    known = (creature.evolution_model, observation_layout(creature), find_crossings(creature))
    tight, padded = lane_major_plant(*known), lane_major_plant(*known, padded=True)
    rng, lanes = np.random.default_rng(0), 8
    qpos = np.tile(creature.stand_qpos[:, None], lanes)
    qpos[creature.joints.qpos_adr] += rng.normal(size=(len(creature.joints.qpos_adr), lanes))
    qpos[2] += np.linspace(-0.3, 0.1, lanes)
    zero = np.zeros((creature.nv, lanes))
    state = BodyState(*map(np.float32, (qpos, zero, zero, zero, np.ones(lanes))))
    depths = [np.asarray(jax.jit(plant.overlap)(state)) for plant in (tight, padded)]
    np.testing.assert_allclose(depths[0], depths[1], atol=1e-6)
    assert np.ptp(depths[0]) > 1e-3
    # Only this part of a step is compiled.
    lowest = [jax.jit(lambda at, p=plant: p.forward(at)[0].geom_low) for plant in (tight, padded)]
    seen = [np.asarray(one(state)) for one in lowest]
    feet = len(creature.feet.foot_of)
    np.testing.assert_allclose(seen[0][:feet], seen[1][:feet], atol=1e-6)
    np.testing.assert_allclose(seen[0][feet:].min(0), seen[1][feet:].min(0), atol=1e-6)


@pytest.mark.thorough("tests/physics/test_bodies.py has it of one step")
def test_a_body_as_constants_has_its_own_program(stool, tmp_path: Path):
    other = changed(tmp_path / "other", *OTHERS["stiffer"])
    assert program(other, physics="mjx") != program(stool, physics="mjx")


@pytest.mark.thorough("tests/physics/test_bodies.py compares steps of bodies as inputs")
def test_a_body_as_inputs_moves_as_in_its_own_program(stool: Creature, tmp_path: Path):
    """The stool's program with another body's numbers, against one made for that body."""
    other = changed(tmp_path / "other", *OTHERS["thicker, so heavier"])
    given, own = (
        build_experiment(body, small_config(rollout={"body": how, "physics": "mjx"}))
        for body, how in ((stool, "inputs"), (other, "constants"))
    )
    its = build_experiment(other, given.config)
    genomes, rows = own.init().genomes, jax.tree.map(lambda leaf: leaf[None], own.row)

    @jax.jit
    def with_numbers(numbers: BodyParams) -> jax.Array:
        simulator = given.spec.simulator(numbers)
        alone = jax.tree.map(lambda leaf: leaf[None], genomes)
        return simulator.simulate(alone, rows.starts, rows.settings).stats.forward[0]

    found = with_numbers(its.spec.numbers)
    expected = jax.jit(own.simulate)(genomes).stats.forward
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert np.abs(found - with_numbers(given.spec.numbers)).max() > 1e-3
