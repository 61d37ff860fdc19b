"""Hundreds of broken and hostile inputs: each gives a creature or one sentence, no traceback,
hang, crash or read outside.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

LARGE, SMALL = 6, 24
"""Shares that the inputs are parted into: large ones, and small ones, one of which always runs."""
SECONDS = 60
"""For a share; one that hangs is killed then. A single input that takes a sixth of it fails too."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "shares"),
    [
        (0, SMALL),
        *(pytest.param(n, LARGE, marks=pytest.mark.thorough("more inputs")) for n in range(LARGE)),
    ],
)
def test_every_input_gives_a_creature_or_a_sentence(tmp_path: Path, share: int, shares: int):
    outside = tmp_path / "outside"
    outside.mkdir()
    os.mkfifo(outside / "secret.stl")  # who opens it waits for ever, be it C or Python
    tests = Path(__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-m", "importer.fuzz_batch", str(tmp_path), str(share), str(shares)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tests)},
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    lines = [line.split(maxsplit=3) for line in done.stdout.splitlines()]
    started = [line[1] for line in lines if line[0] == "start"]
    ended = {line[1]: (float(line[2]), line[3]) for line in lines if line[0] == "end"}
    assert done.returncode == 0, f"at {started[-1:]}: {done.stdout[-300:]} {done.stderr[-2000:]}"
    assert "Traceback" not in done.stderr
    assert len(ended) == len(started) >= 90 * LARGE // shares
    assert {said for _, said in ended.values()} == {"creature", "error"}, [
        (n, s) for n, (_, s) in ended.items() if s not in ("creature", "error")
    ]
    assert max(seconds for seconds, _ in ended.values()) < SECONDS / 6
