"""One process at a time writes a run folder; the others can name it."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from helpers import STOOL, said_by

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.training import lock
from mjxgait.training.folder import create_run
from mjxgait.training.lock import LOCK, locked, running, why_empty

pytest.importorskip("fcntl", reason="this system has no flock")

HOLD = """
import sys
from pathlib import Path
from mjxgait.training.lock import locked
with locked(Path(sys.argv[1])):
    print("locked", flush=True)
    sys.stdin.read()
"""
ME = f"process {os.getpid()} on {socket.gethostname()}"


@contextmanager
def another(folder: Path) -> Iterator[subprocess.Popen]:
    """A process that has locked the folder."""
    command = [sys.executable, "-c", HOLD, str(folder)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **pipes) as process:
        assert process.stdout.readline() == "locked\n"
        try:
            yield process
        finally:
            process.kill()


def test_another_process_is_refused_with_the_name_of_the_first(tmp_path: Path):
    with another(tmp_path) as process:
        who = f"process {process.pid} on {socket.gethostname()}"
        assert running(tmp_path) == who
        with pytest.raises(UserError, match=f"^{tmp_path}: {who} works on it now; wait until"):
            locked(tmp_path).__enter__()
        process.communicate("")
    assert running(tmp_path) is None
    assert not list(tmp_path.iterdir())


def test_a_killed_process_holds_no_lock(tmp_path: Path):
    with another(tmp_path) as process:
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert (tmp_path / LOCK).exists()
        assert running(tmp_path) is None
        with locked(tmp_path):
            assert running(tmp_path) == ME
    assert not (tmp_path / LOCK).exists()


def test_reading_the_lock_does_not_block_a_start(tmp_path: Path, monkeypatch):
    """A reader holds the lock for a moment."""
    (tmp_path / LOCK).touch()
    looks = (tmp_path / LOCK).open("rb")
    assert lock._try(looks, shared=True)
    monkeypatch.setattr("mjxgait.training.lock.time.sleep", lambda seconds: looks.close())
    with locked(tmp_path):
        assert running(tmp_path) == ME


def test_a_just_removed_lock_is_not_mistaken_for_the_new_one(tmp_path: Path, monkeypatch):
    """Else two processes would hold the folder: one by the old file, one by the new."""
    attempt, files = lock._try, []

    def late(file, shared=False):
        if not files:
            (tmp_path / LOCK).unlink()
        files.append(file)
        return attempt(file, shared)

    with monkeypatch.context() as patch:
        patch.setattr(lock, "_try", late)
        held = locked(tmp_path)
        held.__enter__()
    assert len(files) == 2
    assert running(tmp_path) == ME
    held.__exit__(None, None, None)


def test_runs_of_a_folder_are_locked_together(tmp_path: Path):
    (tmp_path / "seed0").mkdir()
    with locked(tmp_path):
        assert running(tmp_path / "seed0") == ME
    assert running(tmp_path / "seed0") is None


def test_a_lock_file_without_content_still_locks(tmp_path: Path):
    with locked(tmp_path):
        (tmp_path / LOCK).write_text("[]")
        assert running(tmp_path) == "another process"


def test_a_run_that_compiles_is_shown_as_running(stool: Creature, tmp_path: Path, capsys):
    run = create_run(tmp_path / "runs" / "new", stool, Config())
    other = shutil.copytree(run, run.with_name("old"))
    ended = "no checkpoint yet; the run ended before its first generation was done"
    said = said_by(capsys, "inspect", run, code=2)
    assert f"{ended}; `mjxgait train --resume {run}` goes on with it" in said
    with locked(run):
        said = said_by(capsys, "inspect", run, code=0)
        assert said == f"{run}: it runs now ({ME}) and has not done its first generation\n"
        found = json.loads(said_by(capsys, "inspect", run, "--json", code=0))
        assert found == {"run": str(run), "problem": None, "running": ME}
        rows = said_by(capsys, "inspect", run.parent, code=0).splitlines()
        states = {row.split()[0]: row.split()[-1] for row in rows[1:3]}
        assert states == {"new": "running", "old": "read"}
        assert rows[3].strip().startswith(f"{other}: {ended}")
        assert "nothing to plot; it runs now" in said_by(capsys, "plot", run, code=2)
    assert "ended before" in why_empty(run)


@pytest.mark.parametrize("command", ["train", "refine"])
def test_a_second_resume_is_refused_with_the_name_of_the_first(
    command: str, stool: Creature, tmp_path: Path, capsys, monkeypatch
):
    run = create_run(tmp_path / "run", stool, Config())
    monkeypatch.setattr("mjxgait.animation.keys.refine.read_original", lambda *_: None)
    with locked(run):
        said = said_by(capsys, command, "--resume", run, code=2)
        assert said == (
            f"mjxgait: {run}: {ME} works on it now; wait until that has ended, or end it first\n"
        )
    assert not (run / LOCK).exists()


def test_a_new_run_is_locked_while_it_evolves(tmp_path: Path, capsys, monkeypatch):
    run, seen = tmp_path / "run", []

    def train(folder, *given):
        seen.append(running(folder))
        return True

    monkeypatch.setattr("mjxgait.training.loop._train", train)
    said_by(capsys, "train", "--env", STOOL, "--no-plots", "--out", run, code=0)
    assert seen == [ME]
    assert not (run / LOCK).exists()
