"""No process of the program runs code from the current folder."""

import os
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pytest
from peers.scaling import Point, measure
from rendering.made_up import treading, write_run

from mjxgait.creature import Creature
from mjxgait.importer import import_model
from mjxgait.processes import SAFE_PATH, process_per_core, python_command, safe_environment
from mjxgait.rendering.gl import working_backend
from mjxgait.rendering.stage import Stage
from mjxgait.rendering.walk import record_walk

TRAP = """
with open({marker!r}, "a") as marker:
    marker.write(__name__ + " ")
"""
NAMES = ("json", "numpy", "multiprocessing", "struct", "pickle", "mujoco", "mjxgait", "tyro", "PIL")


@pytest.fixture
def marker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File that hostile modules in the current folder write."""
    marker, hostile = tmp_path / "marker", tmp_path / "hostile"
    for name in NAMES:
        (hostile / name).mkdir(parents=True)
        (hostile / name / "__init__.py").write_text(TRAP.format(marker=str(marker)))
    monkeypatch.chdir(hostile)
    return marker


def imports(run: Path, creature: Creature) -> None:
    assert import_model(run / "creature" / "creature.xml").files


def renders(run: Path, creature: Creature) -> None:
    """The worker imports its modules and ends at once, as there is no such backend."""
    walk = record_walk(creature, treading(creature), 0.2)
    assert working_backend(Stage([walk], 64, 48), "nonsense")[0] is None


def benchmarks(run: Path, creature: Creature) -> None:
    """The process that measures a point ends at an unknown creature."""
    with pytest.raises(subprocess.CalledProcessError) as failed:
        measure("no-creature", Point())
    assert "no-creature" in failed.value.stderr


def examines(run: Path, creature: Creature) -> None:
    with process_per_core(1) as pool:
        assert pool.submit(int).result() == 0


@pytest.mark.parametrize("act", [imports, renders, benchmarks, examines])
def test_hostile_modules_in_the_current_folder_do_not_run(
    act: Callable[[Path, Creature], None], marker: Path, stool: Creature, tmp_path: Path
):
    act(write_run(tmp_path / "run", stool), stool)
    assert not marker.exists(), marker.read_text()


def test_the_trap_works(marker: Path):
    """With Python's own defaults a process runs code from the current folder."""
    plain = {name: value for name, value in os.environ.items() if name not in SAFE_PATH}
    command = python_command("json.tool", "--help")
    subprocess.run(command, check=True, capture_output=True, env=plain)
    assert not marker.exists()
    subprocess.run([sys.executable, "-m", "json"], check=False, capture_output=True, env=plain)
    assert marker.read_text().startswith("json")


FOLLOWS = """
import sys
from pathlib import Path
from mjxgait.cli.view import following
with following(Path(sys.argv[1])):
    sys.stdin.read()
"""


def test_the_dashboard_ends_with_its_training_and_runs_no_code(
    marker: Path, stool: Creature, tmp_path: Path
):
    """SIGKILL, which no program can catch, ends the training; outside POSIX SIGTERM does so."""
    run = write_run(tmp_path / "run", stool)
    command = [sys.executable, "-P", "-c", FOLLOWS, str(run)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, env=safe_environment(), text=True, **pipes) as training:
        assert training.stdout is not None
        address = training.stdout.readline().split()[0]
        with urllib.request.urlopen(address, timeout=10) as answer:
            assert answer.read()
        training.send_signal(signal.SIGKILL if os.name == "posix" else signal.SIGTERM)
        training.wait()
        assert training.stdout.read() == ""  # the dashboard keeps it open while it runs
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(address, timeout=10)
    assert not marker.exists(), marker.read_text()
