"""A note says when a creature falls back to plain MJX."""

import shutil
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from helpers import STOOL, small_config

from mjxgait.cli.check import check_command
from mjxgait.creature import Creature, load_creature
from mjxgait.physics import SLOWER, fallback_note, make_plant
from mjxgait.physics.lane_major import LaneMajorPlant
from mjxgait.physics.mjx import MjxPlant
from mjxgait.training import loop


@pytest.fixture
def rusty(tmp_path: Path) -> Path:
    """A stool with dry friction in one hip."""
    folder = tmp_path / "rusty"
    shutil.copytree(STOOL, folder)
    text = (folder / "creature.xml").read_text()
    hip = '<joint name="front_left_hip"'
    (folder / "creature.xml").write_text(text.replace(hip, f'{hip} frictionloss="0.1"'))
    return folder


def test_the_note_names_the_element_and_the_cost(rusty: Path):
    plant, _ = make_plant(load_creature(rusty), "auto", True)
    assert isinstance(plant, MjxPlant)
    assert "dry friction (frictionloss): front_left_hip" in plant.note
    assert f"{SLOWER} times" in plant.note
    assert "\n" not in plant.note


def test_there_is_no_note_without_a_fallback(stool: Creature, rusty: Path):
    fast, _ = make_plant(stool, "auto", True)
    assert isinstance(fast, LaneMajorPlant)
    assert fast.note == ""
    assert make_plant(load_creature(rusty), "mjx", True)[0].note == ""
    assert fallback_note(stool.evolution_model) == ""


def test_check_prints_the_note(rusty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    check_command([str(rusty), "--out", str(tmp_path / "picture.png")])
    assert fallback_note(load_creature(rusty).evolution_model) in capsys.readouterr().out
    check_command([str(STOOL), "--out", str(tmp_path / "picture.png")])
    assert "Plain MJX" not in capsys.readouterr().out


class Ready(Exception):
    """Raised when the run is about to compile."""


class Listener:
    """A screen that records messages up to the compilation."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def say(self, text: str) -> None:
        self.said.append(text)

    @contextmanager
    def compiling(self, *_: object):
        raise Ready
        yield


@pytest.mark.parametrize(("note", "said"), [("It is slow.", ["It is slow."]), ("", [])])
def test_a_run_prints_the_note_before_it_compiles(
    note: str, said: list[str], stool: Creature, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    experiment = SimpleNamespace(creature=stool, plant_note=note, config=small_config())
    monkeypatch.setattr(loop, "build_experiment", lambda *_: experiment)
    screen = Listener()
    with pytest.raises(Ready):
        loop.train(tmp_path, stool, small_config(), screen)
    assert screen.said == said
