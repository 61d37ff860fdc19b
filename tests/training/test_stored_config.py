"""A stored configuration has every key, except settings that are newer than the run."""

from pathlib import Path

import pytest

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.training.folder import CONFIG, create_run, open_run, own_version, version_of


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
    with pytest.raises(
        UserError, match=r'config.toml: the key "rollout\.variety" is missing; write'
    ):
        open_run(run)


def test_a_run_names_the_version_that_made_it(stool: Creature, tmp_path: Path):
    run = create_run(tmp_path / "run", stool, Config())
    assert version_of(run) == own_version()


@pytest.mark.parametrize(
    ("line", "by"), [("# Settings of a run, by mjxgait 0.0.9", "mjxgait 0.0.9"), ("", "an earlier")]
)
def test_settings_of_another_version_are_one_sentence(
    line: str, by: str, stool: Creature, tmp_path: Path
):
    run = create_run(tmp_path / "run", stool, Config())
    without(run, "variety = 1\n")
    _, _, rest = (run / CONFIG).read_text(encoding="utf-8").partition("\n")
    (run / CONFIG).write_text(f"{line}\n{rest}", encoding="utf-8")
    with pytest.raises(UserError) as said:
        open_run(run)
    assert f"{run / CONFIG}: made by {by}" in str(said.value)
    assert "train it anew" in str(said.value)
    assert len(str(said.value)) - len(str(run)) < 240


def test_another_version_with_the_same_settings_is_read(stool: Creature, tmp_path: Path):
    run = create_run(tmp_path / "run", stool, Config())
    text = (run / CONFIG).read_text(encoding="utf-8")
    (run / CONFIG).write_text(text.replace(own_version(), "0.0.9", 1), encoding="utf-8")
    assert open_run(run)[1] == Config()
