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

WALKERS = os.environ.get("MJXGAIT_TEST_WALKERS", "unitree a1").split(",")
"""A minute each.

`benchmarks/imported.py` walks the whole list; docs/your-own-creature.md has what came of it.
"""
pytestmark = pytest.mark.slow


def mjxgait(*arguments: object) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mjxgait", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
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
    mjxgait("train", "--env", tmp_path / "mine", "--out", tmp_path / "run", "--no-plots")
    certificate = read_certificate(tmp_path / "run" / CERTIFICATE)
    assert certificate is not None
    assert certificate["passed"]
