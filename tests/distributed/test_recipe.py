"""Recipes: a machine that has only mjxgait can build the same program."""

import pickle
from pathlib import Path

import pytest
from helpers import small_config

from mjxgait.creature import Creature
from mjxgait.distributed.connect import Machine, mismatch, require_same, this
from mjxgait.distributed.jobs import Recipe, UserCode
from mjxgait.errors import UserError
from mjxgait.plugins.registry import find
from mjxgait.plugins.user_code import load, loaded

OWN = """
from mjxgait.tasks.plain import PlainTask

class Idle(PlainTask):
    terms = ("nothing",)

    def evaluate(self, stats, settings):
        return {"nothing": 0.0 * stats.steps}
"""


def test_a_recipe_arrives_unchanged(stool: Creature):
    config = small_config(evolution={"islands": {"count": 3}}, rollout={"ground": "rough:0.03"})
    recipe = pickle.loads(pickle.dumps(Recipe.of(stool, [config])))
    creature, (arrived,) = recipe.read()
    assert arrived == config
    assert creature.digest == stool.digest
    assert recipe.digest == Recipe.of(stool, [config]).digest


def test_other_settings_give_another_digest(stool: Creature):
    one, other = (Recipe.of(stool, [small_config()]) for _ in range(2))
    assert one.digest == other.digest
    warmer = small_config(evolution={"mutation_rate": 0.5})
    assert Recipe.of(stool, [warmer]).digest != one.digest


def test_user_code_is_sent_as_text(stool: Creature, tmp_path: Path):
    part = UserCode("task", "Idle", "idle_travels.py", OWN)
    Recipe(dict(stool.files), (), (part,)).read()
    assert find("task", "idle_travels.py:Idle").__name__ == "Idle"


def test_another_process_does_not_load_a_file_that_is_gone(tmp_path: Path):
    path = tmp_path / "idle_vanishes.py"
    path.write_text(OWN)
    load("task", f"{path}:Idle")
    assert ("task", f"{path}:Idle") in loaded()
    path.unlink()
    assert all("idle_vanishes.py" not in text for _, text in loaded())


def test_machines_with_the_same_versions_can_work_together():
    require_same("10.0.0.7", this())


@pytest.mark.parametrize("name", ["python", "mjxgait", "jaxlib", "mujoco", "code of mjxgait"])
def test_a_version_mismatch_is_one_sentence_with_both_versions(name: str):
    here = this()
    there = Machine({**here.versions, name: "0.0.1"}, here.kind, here.tag)
    with pytest.raises(UserError, match=f"^10.0.0.7 has {name} 0.0.1, this machine has") as said:
        require_same("10.0.0.7", there)
    assert here.versions[name] in str(said.value)
    assert mismatch("10.0.0.7", there) == str(said.value)
