"""The train command: a complete run folder, kills that lose nothing, mistakes in one sentence.

Generations simulate nothing unless stated; `test_library` simulates runs.
"""

import contextlib
import dataclasses
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

import pytest
from helpers import STOOL, made_up_evaluate, said_by

from mjxgait.champion import read_champion
from mjxgait.cli import main
from mjxgait.creature import load_creature
from mjxgait.training import stages
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.experiment import build_experiment
from mjxgait.training.folder import open_run
from mjxgait.training.logs import read_metrics
from mjxgait.training.loop import mend_champion

SMALL = [
    "--env",
    str(STOOL),
    "--population",
    "6",
    "--generations",
    "7",
    "--rollout.seconds",
    "0.4",
    "--rollout.starts",
    "2",
    "--rollout.promote",
    "1",
    "--rollout.lanes",
    "4",
]
SMALL += ["--seed", "5", "--examination.candidates", "0", "--no-plots", "--checkpoint-every", "1"]


COMMAND = """
import sys
from helpers import made_up_evaluate
from mjxgait.cli import main
from mjxgait.training import stages

stages.evaluate = made_up_evaluate
main(sys.argv[1:])
"""
"""The command, with generations that simulate nothing."""

KILLED = """
import os, signal, sys, time
from pathlib import Path
from mjxgait.training.checkpoint import Checkpoints

save = Checkpoints.save

def saved(checkpoints, state, *others):
    save(checkpoints, state, *others)
    if state.generation == 4:
        while not any(Path(sys.argv[-1], "checkpoints").glob("4*")):
            time.sleep(0.0005)
        os.kill(os.getpid(), signal.SIGKILL)

Checkpoints.save = saved
"""
"""Kills its process while it saves generation 4 of the run named by the last argument."""
SIMULATED = "from mjxgait.cli import main; main()"


def command(*arguments: object, code: str = COMMAND) -> list[str]:
    return [sys.executable, "-c", code, *map(str, arguments)]


def ended(*arguments: object, code: str = COMMAND) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments, code=code), capture_output=True, text=True, timeout=300, env=here()
    )


def here() -> dict[str, str]:
    """The environment of a process that finds this process's modules."""
    return os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}


@pytest.fixture(scope="module", autouse=True)
def nothing_is_simulated() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "evaluate", made_up_evaluate)
        yield


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """An uninterrupted run and its output."""
    folder, said = tmp_path_factory.mktemp("runs") / "whole", io.StringIO()
    with contextlib.redirect_stdout(said), pytest.raises(SystemExit) as found:
        main(["train", *SMALL, "--out", str(folder)])
    assert not found.value.code
    return folder, said.getvalue()


def result(folder: Path) -> dict:
    champion = json.loads((folder / "champion.json").read_text())
    return {key: champion[key] for key in ("genome", "fitness", "terms", "origin")}


def without_times(folder: Path) -> list[dict]:
    return [
        {k: v for k, v in line.items() if k not in ("wall_s", "steps_per_second")}
        for line in read_metrics(folder / "metrics.jsonl")
    ]


def test_the_folder_holds_the_whole_run(finished: tuple[Path, str]):
    folder, said = finished
    names = {path.name for path in folder.iterdir()}
    assert names >= {
        "config.toml",
        "creature",
        "metrics.jsonl",
        "checkpoints",
        "champion.json",
        "fitness.png",
    }
    creature, config = open_run(folder)
    assert creature.digest == load_creature(STOOL).digest
    assert (config.seed, config.evolution.population) == (5, 6)
    champion = read_champion(folder / "champion.json", creature)
    lines = read_metrics(folder / "metrics.jsonl")
    assert [line["generation"] for line in lines] == list(range(8))
    assert champion.fitness == pytest.approx(lines[-1]["best"])
    promised = {
        "best",
        "mean",
        "median",
        "worst",
        "unique",
        "forced",
        "failures",
        "evaluations",
        "sim_steps",
        "steps_per_second",
        "wall_s",
    }
    assert promised | {"term_distance", "term_slip"} <= set(lines[0])
    assert (folder / "fitness.png").stat().st_size > 5000
    assert "Compiling" in said


def test_one_plain_line_per_generation_without_a_terminal(finished: tuple[Path, str]):
    lines = [line for line in finished[1].splitlines() if line.startswith("generation")]
    assert len(lines) == 8
    assert all(
        re.search(r"best \S+  mean \S+  alive +\d+%  .* steps/s +\d+ (s|min) left", line)
        for line in lines
    )


def test_the_same_seed_gives_the_same_champion(
    finished: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    said_by(capsys, "train", *SMALL, "--out", tmp_path / "again", code=0)
    assert result(tmp_path / "again") == result(finished[0])
    assert without_times(tmp_path / "again") == without_times(finished[0])


def kill_when(ready: Callable[[], bool], *arguments: object, code: str = COMMAND) -> int:
    """Start a command, kill it as soon as `ready` holds, and return its exit code."""
    process = subprocess.Popen(
        command(*arguments, code=code),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=here(),
    )
    deadline = time.monotonic() + 200
    while not ready() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.001)
    process.kill()
    return process.wait(timeout=60)


def generations(folder: Path, count: int) -> Callable[[], bool]:
    return lambda: (
        (folder / "metrics.jsonl").exists()
        and (folder / "metrics.jsonl").read_bytes().count(b"\n") >= count
    )


def saving(folder: Path, generation: int) -> Callable[[], bool]:
    return lambda: any((folder / "checkpoints").glob(f"{generation}.*tmp*"))


class Killed(BaseException):
    """An exception that the program never catches."""


def test_a_repeatedly_killed_run_reaches_the_same_champion_bit_for_bit(
    finished: tuple[Path, str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
):
    """Ended between log and checkpoint, then killed during a checkpoint."""
    folder, save = tmp_path / "killed", Checkpoints.save

    def saved(checkpoints: Checkpoints, state, *others: str) -> None:
        if state.generation == 2:
            raise Killed
        save(checkpoints, state, *others)

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoints, "save", saved)
        with pytest.raises(Killed):
            main(["train", *SMALL, "--out", str(folder)])
    assert [line["generation"] for line in read_metrics(folder / "metrics.jsonl")] == [0, 1, 2]
    assert not (folder / "checkpoints" / "2").exists()
    process = ended("train", "--no-plots", "--resume", folder, code=KILLED + COMMAND)
    assert process.returncode == -signal.SIGKILL, process.stderr
    assert len(read_metrics(folder / "metrics.jsonl")) < 8
    said_by(capsys, "train", "--resume", folder, "--no-plots", code=0)
    assert result(folder) == result(finished[0])
    assert without_times(folder) == without_times(finished[0])


@pytest.mark.thorough("one that simulates nothing is killed too, and `test_library` repeats a run")
def test_a_repeatedly_killed_simulating_run_reaches_the_same_champion(tmp_path: Path):
    """In its own processes, killed during a generation and during a checkpoint."""
    whole, folder, codes = tmp_path / "whole", tmp_path / "killed", []
    done = ended("train", *SMALL, "--out", whole, code=SIMULATED)
    assert done.returncode == 0, done.stderr
    begin = ("train", *SMALL, "--out", folder)
    for ready in (generations(folder, 2), saving(folder, 4)):
        codes.append(kill_when(ready, *begin, code=SIMULATED))
        begin = ("train", "--resume", folder, "--no-plots")
    assert -signal.SIGKILL in codes, "at most one moment may have passed unseen"
    done = ended(*begin, code=SIMULATED)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert result(folder) == result(whole)
    assert without_times(folder) == without_times(whole)


@pytest.mark.thorough("a run that is killed twice is compared too")
def test_a_run_killed_between_checkpoints_repeats_from_the_first(
    finished: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    folder = tmp_path / "killed"
    arguments = ("train", *SMALL, "--checkpoint-every", "5", "--out", folder)

    def between() -> bool:
        # A checkpoint is written while the run goes on.
        return generations(folder, 4)() and (folder / "checkpoints" / "0").exists()

    assert kill_when(between, *arguments) == -signal.SIGKILL
    kept = [int(path.name) for path in (folder / "checkpoints").iterdir() if path.name.isdigit()]
    assert max(kept) < len(read_metrics(folder / "metrics.jsonl")) - 1
    said_by(capsys, "train", "--resume", folder, "--no-plots", code=0)
    assert result(folder) == result(finished[0])
    assert without_times(folder) == without_times(finished[0])


def test_resuming_an_earlier_checkpoint_drops_later_ones_and_repeats_them(
    finished: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    folder = tmp_path / "again"
    shutil.copytree(finished[0], folder)
    said = said_by(capsys, "train", "--resume", folder, "--generation", "5", "--no-plots", code=0)
    assert "Dropped the checkpoints after generation 5: 6, 7; they come anew." in said
    assert result(folder) == result(finished[0])
    assert without_times(folder) == without_times(finished[0])
    assert {path.name for path in folder.iterdir()} == {p.name for p in finished[0].iterdir()}


def test_a_run_interrupted_twice_gives_the_same_champion(
    finished: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    folder = tmp_path / "stopped"
    said_by(capsys, "train", *SMALL, "--generations", "2", "--out", folder, code=0)
    for last in ("4", "7"):
        said_by(capsys, "train", "--resume", folder, "--generations", last, "--no-plots", code=0)
    assert result(folder) == result(finished[0])


def test_a_damaged_champion_is_rewritten_from_the_checkpoint(
    finished: tuple[Path, str], tmp_path: Path
):
    folder = tmp_path / "damaged"
    shutil.copytree(finished[0], folder)
    (folder / "champion.json").write_text("[]")
    creature, config = open_run(folder)
    experiment = build_experiment(creature, config)
    state = Checkpoints(folder).restore(experiment.abstract(), creature.digest)
    mend_champion(folder, experiment, state)
    assert result(folder) == result(finished[0])
    mend_champion(folder, experiment, dataclasses.replace(state, fitness=state.fitness + 1.0))
    assert result(folder) == result(finished[0]), "one that can be read is left as it is"


def test_a_finished_run_says_how_to_go_on_and_does_nothing(
    finished: tuple[Path, str], tmp_path: Path, capsys, monkeypatch
):
    folder = tmp_path / "over"
    shutil.copytree(finished[0], folder)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    with monkeypatch.context() as patch:
        patch.setattr("mjxgait.cli.training.evolve", None)
        said = said_by(capsys, "train", "--resume", folder, code=0)
    assert said == (
        f"{folder}: nothing is left to do: all 7 generations are done. "
        f"To go on: mjxgait train --resume {folder} --generations 14\n"
    )
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_ctrl_c_finishes_the_generation_saves_and_says_how_to_go_on(
    finished: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    folder = tmp_path / "interrupted"
    arguments = [
        *SMALL,
        "--generations",
        "100000",
        "--evolution.forced.patience",
        "0",
        "--out",
        folder,
    ]
    over = threading.Event()

    def interrupt() -> None:
        while not (generations(folder, 3)() or over.is_set()):
            time.sleep(0.01)
        if not over.is_set():
            signal.raise_signal(signal.SIGINT)

    waiting = threading.Thread(target=interrupt)
    waiting.start()
    try:
        said = said_by(capsys, "train", *arguments, code=130)
    finally:
        over.set()
        waiting.join()
    assert f"mjxgait train --resume {folder}" in said
    last = read_metrics(folder / "metrics.jsonl")[-1]["generation"]
    assert (folder / "checkpoints" / str(last)).is_dir()


def test_next_steps_are_printed_before_plots_that_may_be_interrupted(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    def interrupted(run: Path, formats: tuple[str, ...]):
        raise KeyboardInterrupt

    monkeypatch.setattr("mjxgait.cli.training.evolve", lambda *given: given[-2]() is None)
    monkeypatch.setattr("mjxgait.rendering.plots.plot_run", interrupted)
    said = said_by(capsys, "train", "--env", STOOL, "--out", tmp_path / "run", code=130)
    assert said.index("Next:") < said.index("Drawing") < said.index("mjxgait plot")


@pytest.mark.parametrize("words", [(), ("--quiet",)])
def test_what_a_body_of_the_user_lacks_is_told_before_it_is_evolved(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch
):
    mine = tmp_path / "mine"
    shutil.copytree(STOOL, mine)
    toml = mine / "creature.toml"
    toml.write_text(re.sub(r"torque_limit = \S+", "torque_limit = 0.5", toml.read_text()))
    monkeypatch.setattr("mjxgait.cli.training.evolve", lambda *given: given[-2]() is not None)
    said = said_by(capsys, "train", "--env", mine, "--out", tmp_path / "run", *words, code=130)
    assert ("too weak for its weight" in said) == (not words)


def test_a_folder_with_another_run_is_left_alone(
    finished: tuple[Path, str], capsys: pytest.CaptureFixture
):
    before = result(finished[0])
    assert "holds another run; name another folder with --out, or go on with --resume" in said_by(
        capsys, "train", *SMALL, "--out", finished[0], code=2
    )
    assert result(finished[0]) == before


def test_a_changed_creature_is_refused(
    finished: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    folder = tmp_path / "changed"
    subprocess.run(["cp", "-r", str(finished[0]), str(folder)], check=True)
    xml = folder / "creature" / "creature.xml"
    xml.write_text(xml.read_text().replace("0.04", "0.05"))
    assert "belongs to another body than stool as it is now" in said_by(
        capsys, "train", "--resume", folder, "--generations", "9", code=2
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["trian"], 'unknown subcommand "trian"; did you mean "train"?'),
        (
            ["train", "--env", "dragon"],
            'unknown creature "dragon"; known: alien, blocks, crab, duck, luxo, '
            "short_quadruped, tall_quadruped",
        ),
        (["train", "--config", "nothing.toml"], "nothing.toml: no such file"),
        (["train", "--population", "1"], "population must be at least 2"),
        (["train", "--evolution.populaton", "7"], "--evolution.population"),
        (["train", "--rollout.seconds", "-1"], "rollout.seconds = -1.0"),
        (["train", "--resume", "nowhere"], "nowhere: no such folder"),
        (["train", "--out", "/proc/run"], "cannot be written"),
    ],
)
def test_a_mistake_is_one_sentence_and_exit_code_2(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.chdir(tmp_path)
    assert words in " ".join(said_by(capsys, *arguments, code=2).split())
    assert not list(tmp_path.rglob("config.toml"))


def test_help_reads_well(capsys: pytest.CaptureFixture):
    assert "train" in said_by(capsys, "--help", code=0)
    text = said_by(capsys, "train", "--help", code=0)
    assert "--evolution.population" in text
    assert "--seed" in text
    assert said_by(capsys, "--version", code=0).split() == ["mjxgait", version("mjxgait")]


def test_the_train_script_runs_the_command(tmp_path: Path):
    script = Path(__file__).parents[2] / "scripts" / "train.py"
    done = subprocess.run(
        [sys.executable, str(script), "--env", "dragon"],
        capture_output=True,
        text=True,
        env=os.environ,
        timeout=60,
    )
    assert done.returncode == 2
    assert "unknown creature" in done.stderr
