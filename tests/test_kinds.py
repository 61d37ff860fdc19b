"""Kinds of controllers and tasks are found by their folders, and each has all of its parts."""

from pathlib import Path

import pytest

import mjxgait.tasks
from mjxgait.certification.acceptance import acceptance_of
from mjxgait.errors import UserError
from mjxgait.kinds import controllers, in_water, meant_of_grown, task_kind, tasks
from mjxgait.plugins.registry import find

STILL = """
from mjxgait.kinds import TaskKind

KINDS = (TaskKind("still", __name__, task="task:Still", criteria="criteria:still"),)
"""


@pytest.mark.parametrize("kind", controllers().values(), ids=lambda kind: kind.name)
def test_a_controller_has_all_of_its_parts(kind):
    assert isinstance(kind.part("controller"), type)
    assert callable(kind.part("reference"))
    assert {"document", "genome"} <= set(dir(kind.part("serializer")()))
    assert {"facts", "show"} <= set(dir(kind.part("report")()))


@pytest.mark.parametrize("kind", tasks().values(), ids=lambda kind: kind.name)
def test_a_task_has_all_of_its_parts(kind):
    assert isinstance(kind.part("task"), type)
    acceptance = acceptance_of(kind.name)
    assert acceptance.grown == kind.modular
    assert (acceptance.drag > 0) == kind.water == in_water(kind.name)


def test_a_name_may_mean_another_task_for_modular_bodies():
    assert meant_of_grown("walk") == "roam"
    assert meant_of_grown("swim") == "swim"


def test_a_new_task_needs_only_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    home = tmp_path / "still"
    home.mkdir()
    (home / "__init__.py").write_text(STILL)
    (home / "task.py").write_text("class Still:\n    pass\n")
    (home / "criteria.py").write_text("def still():\n    return 'criteria'\n")
    with pytest.raises(UserError, match='there is no task "still"'):
        task_kind("still")
    monkeypatch.setattr(mjxgait.tasks, "__path__", [*mjxgait.tasks.__path__, str(tmp_path)])
    tasks.cache_clear()
    try:
        assert find("task", "still").__name__ == "Still"
        assert task_kind("still").part("criteria")() == "criteria"
    finally:
        tasks.cache_clear()
