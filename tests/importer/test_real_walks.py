"""Real models: from the file to a certified walk with nothing in between, as a user's commands
do it.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from importer.packages import model_file

from mjxgait.certification import read_certificate
from mjxgait.training.folder import CERTIFICATE

ASKED = os.environ.get("MJXGAIT_TEST_WALKERS", "")
"""Names of models, by commas. One takes three minutes: only those that are asked for are walked.

`benchmarks/imported.py` walks the whole list; docs/guide/your-own-body.md has what came of it.
"""
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not ASKED, reason="MJXGAIT_TEST_WALKERS names no model"),
]


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


@pytest.mark.parametrize("name", ASKED.split(","))
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
