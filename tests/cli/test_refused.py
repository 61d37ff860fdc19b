"""A refused command leaves no folder, so the corrected command can use the same one."""

from pathlib import Path

import pytest
from animation.keys.made import swings, write
from helpers import STOOL, said_by

from mjxgait.api.bodies import write_folder
from mjxgait.config.layers import data_folder, find_file
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.importer import Imported
from mjxgait.importer.notes import Notes
from mjxgait.training.folder import require_output

STUDY = f"""
question = "?"
env = "{STOOL.as_posix()}"
seeds = 2
generations = 1

[[variant]]
name = "usual"

[[variant]]
name = "plain PD"
settings = {{ drive = {{ law = "pd" }} }}
"""
WALKS = ("--env", STOOL, "--speeds", "0.2", "--turns", "10")


@pytest.mark.parametrize(
    "arguments",
    [
        ("train", "--env", STOOL),
        ("train", "--env", STOOL, "--runs", "2"),
        ("train", "--env", STOOL, "--evolution.islands.count", "2"),
        ("repertoire", *WALKS),
        ("ablate", "study.toml"),
    ],
    ids=["a run", "several runs", "islands", "a repertoire", "a study"],
)
def test_an_invalid_cluster_is_refused_first(
    arguments: tuple[object, ...], tmp_path: Path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    out = tmp_path / "out"
    said = said_by(capsys, *arguments, "--cluster", "foo", "--out", out, code=2)
    assert "--cluster foo: give auto or HOST:PORT" in said
    assert not out.exists()


def refuse(*_: object, **__: object) -> None:
    raise UserError("MJX has no such thing")


@pytest.mark.parametrize(
    "arguments",
    [
        ("train", "--env", STOOL),
        ("train", "--env", STOOL, "--runs", "2"),
        ("refine", "--env", STOOL, "--keys", "walk.csv", "--tolerance", "9"),
        ("refine", "--env", STOOL, "--keys", "walk.csv", "--tolerance", "9", "--keep", "1", "0"),
        ("repertoire", *WALKS),
        ("ablate", "study.toml"),
    ],
    ids=["a run", "several runs", "a cycle", "a cycle twice", "a repertoire", "a study"],
)
def test_an_unsupported_body_is_refused_first(
    arguments: tuple[object, ...], stool: Creature, tmp_path: Path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("mjxgait.training.spec.make_plant", refuse)
    (tmp_path / "study.toml").write_text(STUDY)
    write(tmp_path, "csv", stool, swings(stool))
    out = tmp_path / "out"
    assert "no such thing" in said_by(capsys, *arguments, "--out", out, code=2)
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--task", "follow", "--controller", "poses"), "its body grows with its brain, so poses"),
        (("--task", "follow", "--evolution.ancestors.population", 1), "ancestors.population = 1"),
        (("--seed", 2**70), "seed = 1180591620717411303424"),
    ],
    ids=["controller", "ancestors", "seed"],
)
def test_settings_that_evolving_bodies_cannot_have_are_refused_first(
    options: tuple[object, ...], words: str, tmp_path: Path, capsys
):
    out = tmp_path / "out"
    assert words in said_by(capsys, "train", "blocks", *options, "--out", out, code=2)
    assert not out.exists()


@pytest.mark.parametrize("hours", ["0", "nan", "-1"])
def test_a_study_needs_time(hours: str, tmp_path: Path, capsys):
    (tmp_path / "study.toml").write_text(STUDY)
    out = tmp_path / "out"
    study = tmp_path / "study.toml"
    said = said_by(capsys, "ablate", study, "--hours", hours, "--out", out, code=2)
    assert f"--hours {hours}: must be above zero" in said
    assert not out.exists()


@pytest.mark.parametrize(
    "name", ["champion.json", "certificate.json", "config.toml", "fitness.png"]
)
def test_a_runs_own_files_are_no_output(name: str, tmp_path: Path):
    (tmp_path / "config.toml").touch()
    with pytest.raises(UserError, match="the run's own file"):
        require_output(tmp_path / name)
    require_output(tmp_path / "walk.json")
    (tmp_path / "other").mkdir()
    require_output(tmp_path / "other" / name)


def test_a_checkpoint_of_a_new_run_is_refused_first(tmp_path: Path, capsys):
    out = tmp_path / "out"
    said = said_by(capsys, "train", "--env", STOOL, "--out", out, "--generation", "3", code=2)
    assert "needs --resume" in said
    assert not out.exists()


def test_an_invalid_import_is_not_written(tmp_path: Path, stool: Creature):
    files = {**stool.files, "creature.toml": "[creature]\n"}
    with pytest.raises(UserError, match=r"creature\.toml"):
        write_folder(tmp_path / "out", Imported("broken", files, Notes(), True))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("refine", "--task", "walk", "--keys", "walk.csv"), "--task walk: mjxgait refine has no"),
        (("refine", "--env", STOOL, "--keys", "walk.csv", "--keep"), "--keep: give at least one"),
        (("plot", "run", "--formats"), "--formats: give png, svg or both"),
        (("render", "run", "--out", "film.webp", "--top", "0"), "--top 0: must lie between 1 and"),
        (("inspect", "x" * 300), "name too long"),
        (("ablate", "--resume", "study", "--seeds", "32"), "only --hours, --cluster may be given"),
        (("refine", "--resume", "run", "--seed", "3"), "only --quiet, --verbose may be given"),
    ],
    ids=lambda value: " ".join(map(str, value))[:40] if isinstance(value, tuple) else "",
)
def test_an_option_without_an_effect_or_a_value_is_refused(
    arguments: tuple[object, ...], words: str, tmp_path: Path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert words.lower() in said_by(capsys, *arguments, code=2).lower()


def test_a_folder_does_not_hide_a_shipped_file(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wilson").mkdir()
    folder = data_folder("configs")
    assert find_file(Path("wilson"), folder, "config") == folder / "wilson.toml"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("seeds = 2\n", 'seeds = 2\nbase = { use = "hop" }\n', "[base] use = 'hop': give a table"),
        ('{ drive = { law = "pd" } }', "{ evolution = 5 }", "evolution = 5: give a table"),
    ],
)
def test_a_table_of_a_study_must_be_one(old: str, new: str, words: str, tmp_path: Path, capsys):
    assert old in STUDY
    (tmp_path / "study.toml").write_text(STUDY.replace(old, new))
    assert words in said_by(capsys, "ablate", tmp_path / "study.toml", "--dry-run", code=2)
