"""Fixtures that shorten minutes to seconds: short examinations, all in this process."""

import concurrent.futures
import contextlib
import dataclasses
import io
import runpy
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from end_to_end.once import curve_drawn_once, predicted_once, spec_made_once
from end_to_end.unevolved import Unevolved, unevolved, untried
from end_to_end.walks import SHORTER

import mjxgait.processes
from mjxgait.animation.keys import refine
from mjxgait.certification import CertificateConfig, advice
from mjxgait.certification import feasibility as prediction
from mjxgait.certification.stress import StressConfig
from mjxgait.cli import main
from mjxgait.config.tables import build
from mjxgait.creature import overlap
from mjxgait.distributed import evolve as board
from mjxgait.distributed.jobs import Programs
from mjxgait.distributed.scheduler import LocalBackend
from mjxgait.experiments.ablation import findings, measures
from mjxgait.experiments.repertoire import clips
from mjxgait.rendering import curves, painter, plots, video
from mjxgait.training import experiment, loop
from mjxgait.training.prescreen import Prescreen
from mjxgait.web import page

CERTIFICATE = CertificateConfig.__init__
PROGRAMS = Programs()
"""Programs of all studies and multi-seed runs; runs of the same shape share one."""


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Examine with the shipped code, but few initial conditions and short times by default.

    Study reports use few resamples, and pictures are coarse and of few seconds.
    """
    _default(monkeypatch, CertificateConfig, build(CertificateConfig, SHORTER, "short"))
    _default(monkeypatch, StressConfig, StressConfig(starts=4, seconds=1.0, long=2.0))
    monkeypatch.setattr(measures, "SECONDS", 0.5)
    monkeypatch.setattr(measures, "STARTS", 2)
    monkeypatch.setattr(findings, "RESAMPLES", 499)
    for module in (video, plots, page, clips, refine):
        monkeypatch.setattr(module, "LOOP_SECONDS", 4.0)
    monkeypatch.setattr(painter, "SMOOTH", 1)
    for module in (mjxgait.processes, measures):
        monkeypatch.setattr(module, "process_per_core", _one_thread)
    monkeypatch.setattr(subprocess, "run", _run_here(subprocess.run))
    monkeypatch.chdir(tmp_path)


@pytest.fixture(autouse=True)
def sketched(request: pytest.FixtureRequest) -> Iterator[pytest.MonkeyPatch]:
    """Skip the simulation of generations, and repetitions, unless `--thorough` is given."""
    with pytest.MonkeyPatch.context() as patch:
        if not request.config.getoption("--thorough"):
            patch.setattr(loop, "_compiled", unevolved)
            patch.setattr(board, "LocalBackend", partial(Unevolved, PROGRAMS))
            patch.setattr(Prescreen, "begin", lambda prescreen: None)
            patch.setattr(Prescreen, "_program", property(untried))
            patch.setattr(overlap, "SAMPLES", 16)
            patch.setattr(experiment, "make_spec", spec_made_once)
            for module in (advice, prediction):
                patch.setattr(module, "feasibility", predicted_once)
            patch.setattr(curves, "plot_fitness", curve_drawn_once)
        yield patch


@pytest.fixture
def evolving(sketched: pytest.MonkeyPatch, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile and simulate generations as shipped."""
    sketched.undo()
    monkeypatch.setattr(board, "LocalBackend", partial(LocalBackend, PROGRAMS))


@pytest.fixture
def examined_in_full(short: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Examine as long as shipped."""
    monkeypatch.setattr(CertificateConfig, "__init__", CERTIFICATE)


def _default(monkeypatch: pytest.MonkeyPatch, cls: type, short: Any) -> None:
    """Change the defaults of a settings class."""
    plain = cls.__init__
    given = {field.name: getattr(short, field.name) for field in dataclasses.fields(cls)}
    monkeypatch.setattr(cls, "__init__", lambda self, **own: plain(self, **given | own))


@contextlib.contextmanager
def _one_thread(
    most: int | None = None, prepare: Callable[[], object] | None = None
) -> Iterator[concurrent.futures.Executor]:
    """Stand in for `process_per_core`: new processes would run full examinations."""
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        yield pool


def said_by_python(arguments: Sequence[str]) -> tuple[int, str]:
    """Run `python ARGUMENTS` in this process; return the exit code and the output."""
    said, old = io.StringIO(), (sys.argv, list(sys.path))
    siblings = {path.stem for path in Path(arguments[0]).parent.glob("*.py")}
    hidden = {name: sys.modules.pop(name) for name in siblings & sys.modules.keys()}
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            if arguments[:3] == ["-P", "-m", "mjxgait"]:
                main(arguments[3:])
            sys.argv, sys.path[:0] = list(arguments), [str(Path(arguments[0]).parent)]
            runpy.run_path(arguments[0], run_name="__main__")
    except SystemExit as ended:
        if isinstance(ended.code, str):
            return 1, said.getvalue() + ended.code
        return ended.code or 0, said.getvalue()
    finally:
        sys.argv, sys.path[:] = old
        for name in siblings:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)
    return 0, said.getvalue()


def _is_ours(command: Any) -> bool:
    """Return whether a command runs this program or a Python file."""
    if isinstance(command, str) or str(command[0]) != sys.executable:
        return False
    return list(command[1:4]) == ["-P", "-m", "mjxgait"] or str(command[1]).endswith(".py")


def _run_here(run: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap `subprocess.run`: commands of this Python run in this process."""

    def here(command: Any, **options: Any) -> Any:
        if not _is_ours(command):
            return run(command, **options)
        code, said = said_by_python(list(map(str, command[1:])))
        if code and options.get("check"):
            raise AssertionError(f"{command} ended with {code}:\n{said}")
        return subprocess.CompletedProcess(command, code, said, said)

    return here
