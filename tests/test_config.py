"""Settings: strict keys, checked ranges, layers; a mistake is one sentence that names the place."""

import dataclasses
from pathlib import Path

import pytest

from mjxgait.config import Config, data_folder, find_creature, resolve_config
from mjxgait.errors import UserError
from mjxgait.tables import build, dump_toml, read_toml


@pytest.mark.parametrize(
    "path", sorted(data_folder("configs").glob("*.toml")), ids=lambda path: path.stem
)
def test_every_shipped_config_loads(path: Path):
    table = read_toml(path)
    if path.stem != "certificate":
        assert isinstance(build(Config, table, str(path)), Config)


def test_a_config_survives_its_own_file(tmp_path: Path):
    config = build(Config, {"seed": 7, "controller": {"tuning": {"threshold": [0.1, 0.2]}}}, "test")
    (tmp_path / "config.toml").write_text(dump_toml(config))
    assert build(Config, read_toml(tmp_path / "config.toml"), "file") == config


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (
            {"evolution": {"populaton": 3}},
            'unknown key "evolution.populaton"; did you mean "population"?',
        ),
        ({"evolution": {"population": 1}}, "population must be at least 2"),
        ({"evolution": {"growth": 1.0}}, "growth = 1.0 leaves no room for offspring"),
        ({"rollout": {"physics": "warp"}}, "rollout.physics = 'warp'"),
        ({"rollout": {"seconds": float("nan")}}, "rollout.seconds"),
        ({"controller": {"tuning": {"threshold": [0.2, 0.1]}}}, "the first must not be the larger"),
        ({"seed": "x"}, "seed = 'x'"),
        ({"controller": 3}, "controller"),
    ],
)
def test_a_mistake_is_named_with_its_place(table: dict, words: str):
    with pytest.raises(UserError) as error:
        build(Config, table, "mine.toml")
    assert str(error.value).startswith("mine.toml: ")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_layers_creature_over_default_and_file_over_creature(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text("[rollout]\nstarts = 9\n")
    assert resolve_config({"rollout": {"starts": 7, "seconds": 3.0}}, "x").rollout.starts == 7
    both = resolve_config({"rollout": {"starts": 7, "seconds": 3.0}}, "x", file)
    assert (both.rollout.starts, both.rollout.seconds) == (9, 3.0)


def test_a_broken_file_is_named(tmp_path: Path):
    file = tmp_path / "broken.toml"
    file.write_text("[rollout\n")
    with pytest.raises(UserError, match=r"broken.toml: not valid TOML"):
        resolve_config({}, "x", file)


def test_an_unknown_creature_lists_the_known():
    with pytest.raises(UserError, match="short_quadruped, tall_quadruped"):
        find_creature("dragon")


def test_an_unknown_config_names_the_nearest():
    with pytest.raises(UserError, match='did you mean "wilson"'):
        resolve_config({}, "x", Path("wilsn"))


def test_configs_are_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Config().seed = 3  # type: ignore[misc]
