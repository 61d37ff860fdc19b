"""`mjxgait doctor` and `mjxgait cache`: each part is ok or has its remedy."""

import subprocess
import sys
from pathlib import Path

import pytest
from helpers import said_by
from packaging.requirements import Requirement

from mjxgait.cache import clear, own_folder, programs_in
from mjxgait.cli import doctor
from mjxgait.cli.doctor import USES, Finding
from mjxgait.rendering.gl_probe import candidates, working


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An own cache folder with two programs, and a file that is not JAX's."""
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = tmp_path / "mjxgait" / "jax"
    (folder / "worker").mkdir(parents=True)
    for name in ("jit_a-1-cache", "jit_a-1-atime", "worker/jit_b-2-cache"):
        (folder / name).write_bytes(bytes(500_000))
    (folder / "notes.txt").write_text("mine")
    return folder


def test_cache_shows_and_clears_only_programs(home: Path, capsys: pytest.CaptureFixture):
    assert own_folder() == home
    assert said_by(capsys, "cache", code=0) == f"{home}: 2 programs, 1.0 MB\n"
    assert said_by(capsys, "cache", "clear", code=0) == f"{home}: removed 2 programs, 1.0 MB\n"
    assert [file.name for file in home.rglob("*") if file.is_file()] == ["notes.txt"]
    assert said_by(capsys, "cache", code=0) == f"{home}: 0 programs, 0.0 MB\n"


def test_a_shared_cache_is_not_cleared(
    home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(home))
    assert "JAX_COMPILATION_CACHE_DIR" in said_by(capsys, "cache", "clear", code=2)
    assert programs_in(home).number == 2


def test_a_cache_that_does_not_exist_is_empty(tmp_path: Path):
    assert programs_in(tmp_path / "none") == clear(tmp_path / "none") == (0, 0)


def test_this_machine_would_work(capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor, "working", lambda backends: ["egl"])
    said = said_by(capsys, "doctor", code=0)
    names = [line.split()[0] for line in said.splitlines()]
    wanted = ["mjxgait", "jax", "mujoco", "packages", "cores", "memory", "disk", "devices", "GL"]
    assert set(wanted) | set(USES) <= set(names)
    assert "MISSING" not in said
    assert "A run would work" in said


@pytest.mark.parametrize(
    ("found", "kind", "remedy"),
    [
        (doctor.memory(1e9), "optional", "close other programs"),
        (doctor.compiler(lambda name: None), "optional", "install gcc"),
        (Finding("a", "b", "c", needed=True), "MISSING", "c"),
    ],
)
def test_what_is_missing_has_a_remedy(found: Finding, kind: str, remedy: str):
    assert kind in found.line
    assert remedy in found.line


def test_what_is_there_is_ok(tmp_path: Path):
    for found in (doctor.memory(9e9), doctor.memory(None), doctor.disk(tmp_path)):
        assert found.line.split()[1] == "ok"
    assert doctor.compiler(lambda name: "/bin/gcc" if name == "gcc" else None).value == "/bin/gcc"


def test_a_full_disk_and_an_old_package_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(doctor, "ROOM", 1e18)
    found = doctor.disk(tmp_path)
    assert found.needed
    assert "make room" in found.remedy
    old = [Requirement("mujoco<1")], {"video": [Requirement("no-such-package>=1")]}
    monkeypatch.setattr(doctor, "_requirements", lambda: old)
    by_name = {one.name: one for one in doctor.packages()}
    assert "mujoco is" in by_name["packages"].value
    assert by_name["packages"].needed
    assert "no-such-package is not installed" in by_name["video"].value
    assert "[video]" in by_name["video"].remedy
    assert not by_name["video"].needed


def test_broken_devices_are_one_line(monkeypatch: pytest.MonkeyPatch):
    def broken() -> None:
        raise RuntimeError("no driver\nand more")

    monkeypatch.setattr("jax.devices", broken)
    found = doctor.accelerator()
    assert (found.value, found.needed) == ("no driver", True)


@pytest.mark.skipif(sys.platform != "linux", reason="the names of backends on Linux")
def test_only_backends_that_make_a_context_work():
    assert candidates(None) == ["egl", "osmesa"]
    assert candidates("glfw") == ["glfw"]
    assert working(["no_such_backend"]) == []
    assert doctor.renderer("off").remedy == ""


def test_it_needs_no_mujoco():
    """It says what is missing, so it must begin where that is missing."""
    code = (
        "import sys; sys.modules['mujoco'] = None; from mjxgait.cli import main; main(['doctor'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    assert done.stdout.startswith("mjxgait")
