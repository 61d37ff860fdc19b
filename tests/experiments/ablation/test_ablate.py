"""The command as a user runs it: complete report, rows equal to single runs, kills lose nothing."""

import contextlib
import io
import json
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import psutil
import pyarrow.parquet
import pytest
from experiments.ablation import killed
from helpers import STOOL, made_up_evaluate, said_by

import mjxgait.processes
from mjxgait.cli import main
from mjxgait.distributed import evolve
from mjxgait.distributed.jobs import Programs
from mjxgait.distributed.scheduler import LocalBackend
from mjxgait.errors import INTERRUPTED
from mjxgait.experiments.ablation import findings, measures, rows
from mjxgait.training import stages
from mjxgait.training.checkpoint import Checkpoints, Packed
from mjxgait.training.logs import read_metrics

STUDY = f"""
question = "Does plain PD do as well?"
env = "{STOOL.as_posix()}"
seeds = 2
generations = 3

[base]
evolution = {{ population = 6 }}
rollout = {{ seconds = 0.4, starts = 2, lanes = 4 }}

[[variant]]
name = "stable PD"

[[variant]]
name = "plain PD"
settings = {{ drive = {{ law = "pd" }} }}

[[variant]]
name = "three key poses"
settings = {{ controller = {{ key_poses = 3 }} }}
generations = 2
"""


SHORT = Path(__file__).with_name("short_walks.py")


def command(*arguments: object) -> list[str]:
    return [sys.executable, str(SHORT), *map(str, arguments)]


def mjxgait_of_its_own(*arguments: object, code: int = 0) -> str:
    """Output of the command in its own process."""
    done = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout + done.stderr


def ended(*arguments: object, code: int) -> tuple[str, str]:
    """Standard output and error of the command in this process; it must end with this code."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as found,
    ):
        main([*map(str, arguments)])
    assert found.value.code == code, err.getvalue()
    return out.getvalue(), err.getvalue()


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "law.toml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="module", autouse=True)
def cheap() -> Iterator[None]:
    """Compile only evolution, once for all tests; measure 1 s of walking in one process.

    `test_hyper` compiles whole runs together, and `test_cores` counts processes.
    """
    programs = Programs()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "evaluate", made_up_evaluate)
        patch.setattr(evolve, "LocalBackend", partial(LocalBackend, programs))
        patch.setattr(mjxgait.processes, "cores", lambda: 1)
        patch.setattr(measures, "_evaluate", killed.evaluate)
        patch.setattr(findings, "RESAMPLES", 499)
        yield


class Killed(BaseException):
    """An exception that the program does not catch."""


@pytest.fixture(scope="module")
def finished(study: Path) -> tuple[Path, str]:
    """Folder and report of a study that ended during its runs and was killed while measuring.

    First between the log of a generation and its checkpoint, then as when memory runs out, which
    it reports. It is resumed each time.
    """
    folder, keep = study.parent / "out", Checkpoints.keep

    def kept(checkpoints: Checkpoints, state: Packed, *others: str) -> None:
        if state.generation == 1:
            raise Killed
        keep(checkpoints, state, *others)

    said = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(said):
        patch.setattr(Checkpoints, "keep", kept)
        with pytest.raises(Killed):
            main(["ablate", str(study), "--out", str(folder)])
    log = folder / "groups/0/metrics.jsonl"
    assert {line["generation"] for line in read_metrics(log)} == {0, 1}
    told = ended("ablate", "--resume", folder, code=2)[1]
    assert re.fullmatch(
        f"mjxgait: {folder}: .* was killed from outside, .* go on with "
        f"mjxgait ablate --resume {folder}\n",
        told,
    )
    before = (folder / measures.MEASURED).read_text()
    report = ended("ablate", "--resume", folder, code=0)[0]
    assert (folder / measures.MEASURED).read_text().startswith(before)
    return folder, said.getvalue() + report


def test_the_report_holds_everything(finished: tuple[Path, str]):
    folder, said = finished
    assert "3 variants × 2 seeds = 6 runs in 2 programs" in said
    report = (folder / "report.md").read_text()
    for words in (
        "# Does plain PD do as well?",
        "| stable PD |",
        "| plain PD |",
        "What can be concluded, and what cannot",
        "p corrected",
    ):
        assert words in report
    page = (folder / "report.html").read_text()
    assert "<table>" in page
    assert page.count("data:image/png;base64,") == 2
    results = (folder / "results.csv").read_text().splitlines()
    assert len(results) == 1 + 6
    generations = pyarrow.parquet.read_table(folder / "generations.parquet").to_pylist()
    assert len(generations) == 4 * 4 + 2 * 3
    assert {"variant", "seed", "generation", "best", "sim_steps", "term_distance"} <= generations[
        0
    ].keys()


@pytest.fixture(scope="module")
def killed_twice(study: Path) -> Path:
    """Folder of a study that was killed during its runs and again while measuring."""
    folder = study.parent / "killed"
    process = subprocess.Popen(
        command("ablate", study, "--out", folder),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    log = folder / "groups/0/metrics.jsonl"
    while not (log.exists() and any(line["generation"] >= 1 for line in read_metrics(log))):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    process = subprocess.Popen(
        command("ablate", "--resume", folder), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    measured = folder / "measured.jsonl"
    # While it works, not while it starts.
    while not measured.exists() or measured.read_bytes().count(b"\n") < 1:
        assert process.poll() is None
        time.sleep(0.001)
    worker_of(process).kill()
    said = process.communicate(timeout=300)[1].decode()
    assert process.returncode == 2
    assert "was killed from outside" in said
    mjxgait_of_its_own("ablate", "--resume", folder)
    return folder


def worker_of(process: subprocess.Popen) -> psutil.Process:
    """The first process that measures."""
    for child in psutil.Process(process.pid).children():
        with contextlib.suppress(psutil.NoSuchProcess):  # a short-lived query of the system
            if any("spawn_main" in part for part in child.cmdline()):
                return child
    raise AssertionError(process.communicate())


@pytest.mark.thorough("test_hyper compares a row with a run alone, to the bit")
def test_a_row_equals_the_run_of_train(killed_twice: Path, tmp_path: Path):
    """Same seed and settings give the same log, up to the rounding of the two programs.

    `test_hyper` compares a row with the single run bit for bit, on MJX.
    """
    train = "--seed 1 --population 6 --generations 3 --drive.law pd"
    train += " --rollout.seconds 0.4 --rollout.starts 2 --rollout.lanes 4"
    train += " --evolution.forced.patience 0 --examination.candidates 0 --no-plots"
    out = tmp_path / "alone"
    mjxgait_of_its_own("train", "--env", STOOL, *train.split(), "--out", out)
    row = [
        line
        for line in read_metrics(killed_twice / "groups/0/metrics.jsonl")
        if (line["variant"], line["seed"]) == ("plain PD", 1)
    ]
    alone = read_metrics(out / "metrics.jsonl")
    for mine, other in zip(row, alone, strict=True):
        ignored = {"variant", "seed", "wall_s", "steps_per_second", "computed_steps"}
        assert mine.keys() - ignored == other.keys() - ignored
        for key in mine.keys() - ignored:
            if isinstance(mine[key], float):
                assert mine[key] == pytest.approx(other[key], rel=1e-3, abs=1e-5), key
            else:
                assert mine[key] == other[key], key


def test_the_same_data_give_the_same_report_byte_for_byte(
    finished: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture
):
    folder, _ = finished
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    names = (
        "report.md",
        "report.html",
        "results.csv",
        "generations.parquet",
        "curves.png",
        "intervals.png",
    )
    for name in names:
        (copy / name).unlink()
    said_by(capsys, "ablate", "--resume", copy, code=0)
    for name in names:
        assert (copy / name).read_bytes() == (folder / name).read_bytes(), name


def test_a_resumed_study_equals_an_uninterrupted_one(
    finished: tuple[Path, str], study: Path, tmp_path: Path
):
    (tmp_path / "whole-was-killed").touch()
    ended("ablate", study, "--out", tmp_path / "whole", code=0)
    for name in ("results.csv", "generations.parquet"):
        assert (tmp_path / "whole" / name).read_bytes() == (finished[0] / name).read_bytes()


@pytest.mark.thorough("a study that stopped amid its runs and lost a process is compared too")
def test_a_study_killed_twice_equals_an_uninterrupted_one(
    killed_twice: Path, study: Path, tmp_path: Path
):
    mjxgait_of_its_own("ablate", study, "--out", tmp_path / "whole")
    for name in ("results.csv", "generations.parquet"):
        assert (tmp_path / "whole" / name).read_bytes() == (killed_twice / name).read_bytes()


def test_ctrl_c_in_the_last_generation_ends_a_study_before_measuring(
    finished: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The runs are complete, but measuring takes minutes too."""
    copy = shutil.copytree(finished[0], tmp_path / "copy")
    (copy / measures.MEASURED).unlink()

    @contextlib.contextmanager
    def interrupted() -> Iterator[threading.Event]:
        event = threading.Event()
        event.set()
        yield event

    monkeypatch.setattr(rows, "interruptible", interrupted)
    said = ended("ablate", "--resume", copy, code=INTERRUPTED)[0]
    assert f"go on with: mjxgait ablate --resume {copy}" in said
    assert not (copy / measures.MEASURED).exists()


def test_a_study_that_would_take_days_is_refused_with_the_estimate(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture
):
    arguments = ("--generations", "10000000", "--out", tmp_path / "x")
    said = said_by(capsys, "ablate", study, *arguments, code=2)
    assert "hours" in said
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nosuch"], "nosuch: no such file"),
        ([], "name the file of a study"),
        (["--resume", "nowhere"], "not the folder of a study"),
        (["switches", "--env", "dragon"], 'unknown creature "dragon"'),
    ],
)
def test_mistakes_are_one_sentence(arguments: list[str], words: str, capsys: pytest.CaptureFixture):
    assert words in said_by(capsys, "ablate", *arguments, code=2)


def test_a_folder_in_use_is_left_alone(
    finished: tuple[Path, str], study: Path, capsys: pytest.CaptureFixture
):
    folder, _ = finished
    before = json.dumps(sorted(path.name for path in folder.iterdir()))
    assert "--resume" in said_by(capsys, "ablate", study, "--out", folder, code=2)
    assert json.dumps(sorted(path.name for path in folder.iterdir())) == before
