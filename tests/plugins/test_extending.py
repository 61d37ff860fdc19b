"""The examples of docs/guide/your-own-task.md work."""

import csv
import io
import json
import re
import shlex
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from helpers import SHORT, STOOL
from rich.console import Console

from mjxgait.cli import main
from mjxgait.cli.view import following
from mjxgait.training.folder import own_options
from mjxgait.training.screen import Screen

PAGE = Path(__file__).parents[2] / "docs" / "guide" / "your-own-task.md"
SMALL = (
    "--population 6 --generations 1 --rollout.seconds 0.4 --rollout.starts 2"
    " --rollout.promote 1 --rollout.lanes 4 --examination.candidates 0 --no-plots"
)


def blocks(language: str) -> list[str]:
    """Code blocks of the page in a language."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def call(command: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(shlex.split(command))
    return int(ended.value.code or 0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Folder with the page's code as `my.py`."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "my.py").write_text("\n\n".join(blocks("python")))
    (folder / "short.toml").write_text(SHORT)
    return folder


@pytest.fixture(scope="module")
def trained(folder: Path) -> Path:
    """Run of the page's commands, on a small body and for a short time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        train, certify, inspect = "".join(blocks("sh")).strip().splitlines()
        extra = {train: SMALL, certify: "--config short.toml", inspect: ""}
        for line, options in extra.items():
            command = line.removeprefix("mjxgait ").replace("tall_quadruped", str(STOOL))
            assert call(f"{command} {options}") == 0, line
    return folder / "runs" / "own"


def test_the_examples_are_short():
    """At most 24 lines each, without imports and blank lines."""
    for code in blocks("python"):
        _, _, classes = code.partition("\n\n\n")
        assert len([line for line in classes.splitlines() if line.strip()]) <= 24


def test_the_champion_names_the_users_own_code(trained: Path):
    champion = json.loads((trained / "champion.json").read_text())
    assert (champion["controller"], champion["task"]) == ("my.py:Spin", "my.py:Stand")
    assert {name: len(values) for name, values in champion["genome"].items()} == {
        "middle": 4,
        "swing": 4,
        "phase": 4,
    }
    assert set(champion["terms"]) == {"alive", "moved"}


def test_the_examination_uses_the_tasks_own_criteria(trained: Path):
    document = json.loads((trained / "certificate.json").read_text())
    assert [c["number"] for c in document["criteria"]] == [1, 4, 5, 6, 8, 9, 10]
    stays = document["criteria"][-1]["measures"][0]
    assert stays["threshold"] == 0.1
    assert stays["value"] > 0


def test_evolution_and_reference_simulator_agree(trained: Path):
    """They agree on how long the body stands undisturbed."""
    champion = json.loads((trained / "champion.json").read_text())
    assert champion["origin"]["nominal"]["seconds"] == pytest.approx(0.4)


STUDY = f"""
question = "How much mutation does the user's own controller want?"
env = "{STOOL.as_posix()}"
seeds = 2
generations = 1
certify = false
grounds = ["flat", "rough:0.1"]

[base]
use = {{ controller = "my.py:Spin" }}
evolution = {{ population = 6 }}
rollout = {{ seconds = 0.4, lanes = 4 }}

[[variant]]
name = "much"

[[variant]]
name = "less"
settings = {{ evolution = {{ mutation_rate = 0.2 }} }}
"""


@pytest.mark.thorough("another test trains it; tests/experiments/ablation runs a study")
def test_own_code_takes_part_in_studies(folder: Path, monkeypatch: pytest.MonkeyPatch):
    """The processes that measure champions, here on two grounds, load the code too."""
    monkeypatch.chdir(folder)
    (folder / "study.toml").write_text(STUDY)
    assert call("ablate study.toml --controller my.py:Spin --out study") == 0
    with (folder / "study" / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert any(row["walk"] != row["walk on rough:0.1"] for row in rows)
    assert "## On rough:0.1" in (folder / "study" / "report.md").read_text()


def test_no_code_is_loaded_from_a_run(trained: Path, capfd, monkeypatch):
    from mjxgait import kinds

    monkeypatch.setattr(kinds, "_OWN", {})
    monkeypatch.chdir(trained.parents[1])
    assert call(f"inspect {trained} --task=my.py:Stand") == 2
    said, whole = capfd.readouterr().err.splitlines()
    assert said.startswith(f"mjxgait: {trained}: ")
    assert "never loaded from a run folder" in said
    assert whole == (
        f"The whole command: mjxgait inspect {trained} --controller my.py:Spin --task my.py:Stand"
    )
    assert call(whole.partition("mjxgait ")[2]) == 0


def test_the_next_steps_name_the_users_own_code(trained: Path, monkeypatch):
    """The path of the file is right in any current folder."""
    out = io.StringIO()
    screen = Screen(Console(file=out, width=300))
    monkeypatch.chdir(trained.parents[1])
    screen.next_steps(trained, certified=False)
    *_, last = out.getvalue().splitlines()
    command = last.split("   ")[0].strip().removeprefix("mjxgait ")
    assert command == f"inspect {trained} --controller my.py:Spin --task my.py:Stand"
    assert call(command) == 0
    monkeypatch.chdir(trained)
    file = trained.parents[1] / "my.py"
    assert own_options(trained)[1::2] == [f"{file}:Spin", f"{file}:Stand"]


def test_a_run_without_the_path_of_its_code_gives_the_name(trained: Path, tmp_path: Path):
    """Runs of earlier versions lack the path. Only plain text is printed."""
    for name in ("config.toml", "own.toml"):
        shutil.copy(trained / name, tmp_path)
    (tmp_path / "own.toml").write_text('controller = "\\u001b[2J"\ntask = 3\n')
    named = ["--controller", "my.py:Spin", "--task", "my.py:Stand"]
    assert own_options(tmp_path) == named
    (tmp_path / "own.toml").unlink()
    assert own_options(tmp_path) == named


def test_the_dashboard_of_a_run_gets_the_same_code(folder: Path, trained, monkeypatch):
    """The command line decides, not the run folder."""
    started: list[list[str]] = []

    def start(words: list[str], **_: object) -> SimpleNamespace:
        started.append(words)
        return SimpleNamespace(terminate=lambda: None, communicate=lambda: None)

    monkeypatch.setattr("subprocess.Popen", start)
    with following(trained):
        pass
    own = {*started[0][5:]}
    assert own >= {"--controller", f"{folder / 'my.py'}:Spin", f"{folder / 'my.py'}:Stand"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--controller nothere.py:Spin", "no such file"),
        ("--controller my.py:Nobody", 'has no class "Nobody"'),
        (
            "--controller my.py:Stand",
            "must inherit from mjxgait.controllers.base.RealController",
        ),
        ("--controller half.py:Half", "Half lacks act"),
        ("--controller broken.py:X", "cannot be loaded (ZeroDivisionError"),
        ("--controller rare.py:Rare", "Rare.every = 3: must be one of 1, 2, 4, 8, 16"),
        ("--task old.py:Old", "Old.judge is now called evaluate; rename it"),
        ("--controller posse", 'did you mean "poses"'),
        ("--task my.py", "give FILE.py:CLASS"),
        ("--task", "name one of hop"),
        ("--use.controller my.py:Other", "name it with --controller FILE.py:CLASS"),
        ("--controller wild.py:Wild", 'there is no observation "jont_pos"'),
    ],
)
def test_a_mistake_is_one_sentence(folder: Path, arguments, words, capfd, monkeypatch):
    monkeypatch.chdir(folder)
    head = "from mjxgait.controllers.base import RealController\n"
    bounds = "    def bounds(self, settings):\n        return {'a': (0.0, 1.0)}\n"
    act = "    def act(self, plan, memory, senses):\n        return 0, memory\n"
    (folder / "half.py").write_text(f"{head}class Half(RealController):\n{bounds}")
    (folder / "broken.py").write_text("1 / 0\n")
    old = "from mjxgait.tasks.plain import PlainTask\nclass Old(PlainTask):\n"
    (folder / "old.py").write_text(
        f"{old}    def judge(self, stats, settings):\n        return {{}}\n"
    )
    wild = f"class Wild(RealController):\n    reads = ('jont_pos',)\n{bounds}{act}"
    (folder / "wild.py").write_text(head + wild)
    (folder / "rare.py").write_text(
        f"{head}class Rare(RealController):\n    every = 3\n{bounds}{act}"
    )
    assert call(f"train --env {STOOL} --out runs/none {arguments}") == 2
    said = capfd.readouterr().err
    assert words in said
    assert "Traceback" not in said
    assert not (folder / "runs" / "none").exists()
