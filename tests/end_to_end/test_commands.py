"""Every subcommand succeeds on runs that the command itself made."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from animation.keys.made import columns, swings
from end_to_end.shipped import CONFIGS, CREATURES, ROOT, STUDIES, STYLES, TASKS
from end_to_end.walks import faller, short_examination, small_settings, trained, walker
from helpers import STOOL, said_by
from web.engine import engine_folder

from mjxgait.api import Run, certify
from mjxgait.certification import read_certificate
from mjxgait.cli import COMMANDS
from mjxgait.creature import load_creature
from mjxgait.experiments.leaderboard import entry_of
from mjxgait.training.folder import CERTIFICATE, METRICS, open_run
from mjxgait.training.logs import read_metrics

ELSEWHERE = {
    "build": "tests/hardware/test_robot.py::test_a_build_folder_holds_closed_parts_a_bill_and_a_model",
    "completion": "tests/end_to_end/test_commands.py::test_completion_knows_commands_and_options",
    "train": "tests/end_to_end/test_trainings.py::test_a_training_ends_with_a_certificate",
    "ablate": "tests/end_to_end/test_studies.py::test_a_study_ends_with_its_report",
    "view": "tests/web/test_live.py",
}
"""Subcommands with their own tests, and where."""

SHELLS = ("bash", "zsh", "fish")
Made = Callable[[Path], tuple[list[str], str]]
"""Makes the arguments of a subcommand in a folder, and names the file it writes there."""


def of_run(*more: str, writes: str) -> Made:
    """A subcommand that takes a run folder first."""
    return lambda folder: ([str(walker(folder / "run")), *more], writes)


def refined(folder: Path) -> tuple[list[str], str]:
    stool = load_creature(STOOL)
    (folder / "walk.csv").write_text(columns(stool, swings(stool)))
    given = ["--env", str(STOOL), "--keys", "walk.csv", "--config", small_settings(folder)]
    given += ["--tolerance", "20", "--generations", "1", "--out", "refined"]
    return given, f"refined/{CERTIFICATE}"


def examined(folder: Path) -> tuple[list[str], str]:
    given = [str(walker(folder / "run")), "--config", short_examination(folder)]
    return given, f"run/{CERTIFICATE}"


def simulated(folder: Path) -> tuple[list[str], str]:
    given = [str(walker(folder / "run")), "--physics", "--wasm", str(engine_folder())]
    return [*given, "--out", "live.html"], "live.html"


def gathered(folder: Path) -> tuple[list[str], str]:
    given = ["--env", str(STOOL), "--speeds", "0.3", "--turns", "10"]
    given += ["--config", small_settings(folder), "--generations", "1", "--out", "set"]
    return given, "set/map.png"


def shown(folder: Path) -> tuple[list[str], str]:
    given = [str(walker(folder / "run")), "--out", "all.html", "--poster", "all.png"]
    return given, "all.html"


def evolved_and_shown(folder: Path) -> tuple[list[str], str]:
    given = ["--task", "walk", "--env", str(STOOL), "--runs", "2", "--study", "set"]
    return [*given, "--generations", "1", "--population", "4"], "set/gallery.html"


def ranked(folder: Path) -> tuple[list[str], str]:
    run = faller(folder / "run")
    certify(run, short_examination(folder))
    return ["add", str(run), "--board", "board.jsonl"], "board.jsonl"


FORMS: dict[str, list[Made]] = {
    "refine": [refined],
    "certify": [examined],
    "stress": [of_run("--starts", "4", writes="run/stress.json")],
    "inspect": [of_run(writes=""), of_run("--all", "--json", writes="")],
    "plot": [of_run("--formats", "png", writes="run/plots/filmstrip.png")],
    "render": [
        of_run(
            *("--seconds", "0.4", "--size", "320", "180", "--out", f"walk.{kind}"),
            writes=f"walk.{kind}",
        )
        for kind in ("png", "webp")
    ],
    "export": [of_run("--out", f"walk.{kind}", writes=f"walk.{kind}") for kind in ("glb", "bvh")],
    "share": [of_run("--out", "walk.html", writes="walk.html"), simulated],
    "gallery": [shown, evolved_and_shown],
    "repertoire": [gathered],
    "import": [
        lambda folder: ([str(STOOL / "creature.xml"), "--out", "mine"], "mine/creature.toml")
    ],
    "check": [
        lambda folder, name=name: ([name, "--out", "seen.png"], "seen.png") for name in CREATURES
    ],
    "leaderboard": [ranked, lambda folder: ([], "")],
    "list": [lambda folder: ([], "")],
    "doctor": [lambda folder: ([], "")],
    "cache": [lambda folder: ([], ""), lambda folder: (["show"], "")],
}
EACH = [(name, number) for name, forms in FORMS.items() for number in range(len(forms))]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "number"), EACH, ids=[f"{name}-{n}" for name, n in EACH])
def test_a_subcommand_succeeds(
    name: str, number: int, tmp_path: Path, capsys: pytest.CaptureFixture
):
    given, writes = FORMS[name][number](tmp_path)
    said = said_by(capsys, name, *given, code=0)
    assert "Traceback" not in said
    assert (tmp_path / writes).exists()


def test_every_subcommand_is_tested():
    assert FORMS.keys() | ELSEWHERE.keys() == COMMANDS.keys()
    assert not FORMS.keys() & ELSEWHERE.keys()
    for place in ELSEWHERE.values():
        file, _, test = place.partition("::")
        assert f"def {test}" in (ROOT / file).read_text(encoding="utf-8")


def test_a_leaderboard_entry_counts_all_generations(tmp_path: Path):
    ranked(tmp_path)
    lines = read_metrics(tmp_path / "run" / METRICS)
    entry = entry_of(tmp_path / "run", None, "2 cores")
    assert len(lines) == 2
    assert entry.seconds == pytest.approx(lines[0]["wall_s"] + lines[1]["wall_s"])
    assert entry.evaluations == lines[0]["evaluations"] + lines[1]["evaluations"]


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_knows_commands_and_options(shell: str, capsys: pytest.CaptureFixture):
    said = said_by(capsys, "completion", shell, code=0)
    assert all(name in said for name in COMMANDS)
    assert "--evolve-body" in said


def test_list_names_everything_that_ships(capsys: pytest.CaptureFixture):
    said = said_by(capsys, "list", code=0)
    sections = [section.splitlines() for section in said.strip().split("\n\n")]
    named = {head.split()[0]: [line.split()[0] for line in lines] for head, *lines in sections}
    assert named["creatures"] == CREATURES
    assert named["configurations"] == CONFIGS
    assert set(TASKS) <= set(named["tasks"])
    assert named["styles"] == STYLES
    assert named["studies"] == STUDIES
    assert {"controllers", "gaits", "grounds"} <= named.keys()
    assert all(len(line.split()) > 1 for _, *lines in sections for line in lines)
    assert said_by(capsys, "envs", code=0) == said


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_subcommand_has_its_example(name: str, capsys: pytest.CaptureFixture):
    said = said_by(capsys, name, "--help", code=0)
    assert f"Example: {COMMANDS[name].example}" in said
    assert "NoneType" not in said
    assert "{None}" not in said
    if name == "train":
        assert len(said.splitlines()) < 60
        assert "--evolution.elite" not in said


@pytest.mark.slow
def test_certify_repeats_the_result_of_the_run(tmp_path: Path, capsys: pytest.CaptureFixture):
    run = trained(tmp_path / "run")
    before = json.loads((run / CERTIFICATE).read_text())
    said_by(capsys, "certify", run, "--config", short_examination(tmp_path), code=0)
    after = read_certificate(run / CERTIFICATE)
    assert after["champion"] == before["champion"]
    assert after["criteria"] == before["criteria"]


@pytest.mark.slow
def test_each_seed_of_a_multi_seed_run_gets_a_certificate(
    tmp_path: Path, capsys: pytest.CaptureFixture
):
    given = ("--env", STOOL, "--config", small_settings(tmp_path), "--generations", 1, "--runs", 2)
    said_by(capsys, "train", *given, "--seed", 3, "--out", "zoo", code=0)
    for seed in (3, 4):
        folder = next(path.parent for path in Path("zoo").glob(f"*{seed}/{CERTIFICATE}"))
        assert open_run(folder)[1].seed == seed
    shutil.rmtree("zoo")


@pytest.mark.parametrize("certified", [3, 4, None])
def test_tries_go_on_until_a_run_is_certified(
    certified: int | None, tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch
):
    """Of three, from seed 3 on. certified: first seed with a certified run, if any."""
    monkeypatch.setattr(Run, "certified", property(lambda run: _seed(run.folder) == certified))
    given = ("--env", STOOL, "--config", small_settings(tmp_path), "--generations", 1)
    said = said_by(
        capsys, "train", *given, "--seed", 3, "--tries", 3, "--no-plots", "--out", "run", code=0
    )
    seeds = range(3, (certified or 5) + 1)
    made = {path.name: _seed(path) for path in Path().glob("run*")}
    assert made == {"run" if seed == 3 else f"run-seed{seed}": seed for seed in seeds}
    assert said.count("Not certified: seed") == len(seeds) - 1


def test_no_run_begins_if_the_folder_of_a_later_one_is_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture
):
    Path("run-seed1").mkdir()
    Path("run-seed1/mine.txt").write_text("mine")
    said = said_by(capsys, "train", "--env", STOOL, "--tries", 2, "--out", "run", code=2)
    assert "run-seed1: holds something else" in said
    assert not Path("run").exists()


def _seed(folder: Path) -> int:
    return open_run(folder)[1].seed
