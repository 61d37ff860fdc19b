"""A body whose numbers are inputs of the program: the next of its make-up needs no compilation."""

import re
import shutil
from pathlib import Path

import jax
import numpy as np
import pytest
from helpers import STOOL, small_config

from mjxgait.creature import Creature, load_creature
from mjxgait.runs.experiment import Batch, build_experiment

INPUTS = {"body": "inputs", "physics": "auto"}


def changed(folder: Path, pattern: str, factor: float) -> Creature:
    """The stool with the first number of every match of a pattern times a factor."""
    shutil.copytree(STOOL, folder, dirs_exist_ok=True)
    for name in ("creature.xml", "creature.toml"):
        text = (folder / name).read_text()
        text = re.sub(pattern, lambda m: f"{m[1]}{float(m[2]) * factor:.6g}", text)
        (folder / name).write_text(text)
    return load_creature(folder)


OTHERS = {
    "thicker, so heavier": (r'(size=")([\d.]+)', 1.1),
    "stiffer": (r"(kp = )([\d.]+)", 1.5),
    "weaker": (r"(torque_limit = )([\d.]+)", 0.5),
}


def program(creature: Creature, **rollout) -> str:
    return Batch((build_experiment(creature, small_config(rollout=rollout)),)).lower().as_text()


@pytest.fixture(scope="module")
def stools(stool) -> str:
    return program(stool, **INPUTS)


@pytest.mark.parametrize("change", OTHERS)
def test_another_body_has_the_same_program(stools: str, change: str, tmp_path: Path):
    assert program(changed(tmp_path / "other", *OTHERS[change]), **INPUTS) == stools


def test_as_constants_it_has_one_of_its_own(stool, tmp_path: Path):
    other = changed(tmp_path / "other", *OTHERS["stiffer"])
    assert program(other, physics="mjx") != program(stool, physics="mjx")


@pytest.mark.parametrize("change", ["thicker, so heavier", "weaker"])
def test_the_motion_is_that_of_the_bodys_own_program(change: str, tmp_path: Path):
    """Outcomes of a few individuals, by the host's own constants and by the inputs."""
    other = changed(tmp_path / "other", *OTHERS[change])
    found = []
    for body in ("constants", "inputs"):
        config = small_config(rollout={"body": body, "physics": "mjx"})
        experiment = build_experiment(other, config)
        step = experiment.compile()
        state, _ = step(experiment.place(experiment.init()))
        found.append(jax.device_get((state.outcome, state.terms)))
    for mine, its in zip(*found, strict=True):
        np.testing.assert_allclose(mine, its, rtol=2e-3, atol=2e-4)
