"""Real models: from the file to a certified walk with nothing in between, as a user's commands
do it.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from importing.packages import model_file

from mjxgait.certify import read_certificate
from mjxgait.runs.folder import CERTIFICATE

ASKED = os.environ.get("MJXGAIT_TEST_WALKERS")
WALKERS = (ASKED or "unitree a1").split(",")
"""Three minutes each to a certificate, which only those have to earn who are asked for by name.

`benchmarks/imported.py` walks the whole list; docs/your-own-creature.md has what came of it.
"""
pytestmark = pytest.mark.slow


def mjxgait(*arguments: object) -> None:
    # As a user has it: without optimization, as other tests compile, a generation takes ten times
    # as long.
    shipped = {k: v for k, v in os.environ.items() if k != "JAX_DISABLE_MOST_OPTIMIZATIONS"}
    done = subprocess.run(
        [sys.executable, "-m", "mjxgait", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=shipped,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", WALKERS)
def test_file_to_certified_walk(tmp_path: Path, name: str):
    path, search = model_file(name)
    mjxgait(
        "import",
        path,
        "--out",
        tmp_path / "mine",
        *(word for folder in search for word in ("--search", folder)),
    )
    long = () if ASKED else ("--generations", 2, "--examination.candidates", 1)
    mjxgait("train", "--env", tmp_path / "mine", "--out", tmp_path / "run", "--no-plots", *long)
    certificate = read_certificate(tmp_path / "run" / CERTIFICATE)
    assert certificate is not None
    assert certificate["passed"] or not ASKED
