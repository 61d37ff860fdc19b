"""Runs in seconds what takes minutes: short examinations, and no process but this one."""

import concurrent.futures
import contextlib
import dataclasses
import io
import runpy
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from helpers import SHORT

import mjxgait.cores
from mjxgait.ablation import measures
from mjxgait.certify import CertificateConfig
from mjxgait.certify.stress import StressConfig
from mjxgait.cli import main
from mjxgait.settings.tables import build

EXAMINED = {"seconds": 2.0, "warmup": 0.3, "hop": {"stay": 0.5}, "limbo": {"stay": 0.5}}
"""Over `SHORT`: s of an examination, and of the rest of a lamp at its end."""


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The code of an examination is as shipped; its defaults are few starts and short times."""
    table = tomllib.loads(SHORT) | EXAMINED
    _default(monkeypatch, CertificateConfig, build(CertificateConfig, table, "short"))
    _default(monkeypatch, StressConfig, StressConfig(starts=4, seconds=1.0, long=2.0))
    monkeypatch.setattr(measures, "SECONDS", 0.5)
    monkeypatch.setattr(measures, "STARTS", 2)
    for module in (mjxgait.cores, measures):
        monkeypatch.setattr(module, "process_per_core", _one_thread)
    monkeypatch.setattr(subprocess, "run", _run_here(subprocess.run))
    monkeypatch.chdir(tmp_path)


def _default(monkeypatch: pytest.MonkeyPatch, cls: type, short: Any) -> None:
    """Give a class of settings other defaults."""
    plain = cls.__init__
    given = {field.name: getattr(short, field.name) for field in dataclasses.fields(cls)}
    monkeypatch.setattr(cls, "__init__", lambda self, **own: plain(self, **given | own))


@contextlib.contextmanager
def _one_thread(
    most: int | None = None, prepare: Callable[[], object] | None = None
) -> Iterator[concurrent.futures.Executor]:
    """Stand in for `process_per_core`: new processes would know nothing of short examinations."""
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        yield pool


def said_by_python(arguments: Sequence[str]) -> tuple[int, str]:
    """Run `python ARGUMENTS` in this process; return the exit code and what it printed."""
    said, old = io.StringIO(), sys.argv
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            if arguments[:2] == ["-m", "mjxgait"]:
                main(arguments[2:])
            sys.argv = list(arguments)
            runpy.run_path(arguments[0], run_name="__main__")
    except SystemExit as ended:
        if isinstance(ended.code, str):
            return 1, said.getvalue() + ended.code
        return ended.code or 0, said.getvalue()
    finally:
        sys.argv = old
    return 0, said.getvalue()


def _run_here(run: Callable[..., Any]) -> Callable[..., Any]:
    """Return `subprocess.run` that stays in this process where it would start `mjxgait` or a script."""

    def here(command: Any, **options: Any) -> Any:
        given = [] if isinstance(command, str) else list(map(str, command))
        ours = given[1:3] == ["-m", "mjxgait"] or (len(given) > 1 and given[1].endswith(".py"))
        if not ours or given[0] != sys.executable:
            return run(command, **options)
        code, said = said_by_python(list(map(str, command[1:])))
        if code and options.get("check"):
            raise AssertionError(f"{command} ended with {code}:\n{said}")
        return subprocess.CompletedProcess(command, code, said, said)

    return here
