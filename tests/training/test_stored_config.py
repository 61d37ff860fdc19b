"""A stored configuration has every key, except settings that are newer than the run."""

from pathlib import Path

import pytest

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.training.folder import CONFIG, create_run, open_run


def without(folder: Path, line: str) -> None:
    path = folder / CONFIG
    text = path.read_text(encoding="utf-8")
    assert text.count(line) == 1
    path.write_text(text.replace(line, ""), encoding="utf-8")


def test_a_run_from_before_a_setting_existed_does_what_it_did(stool: Creature, tmp_path: Path):
    run = create_run(tmp_path / "run", stool, Config())
    without(run, "hold = 1\n")
    assert open_run(run)[1] == Config()


def test_a_key_that_was_lost_is_named(stool: Creature, tmp_path: Path):
    run = create_run(tmp_path / "run", stool, Config())
    without(run, "variety = 1\n")
    with pytest.raises(UserError, match=r'config.toml: the key "rollout\.variety" is missing'):
        open_run(run)
