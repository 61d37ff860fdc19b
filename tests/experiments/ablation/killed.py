"""A process that measures champions for 1 s each and is killed once, as when memory runs out.

In its own file, because the measuring processes import it by name.
"""

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

from mjxgait.experiments.ablation import measures
from mjxgait.experiments.ablation.measures import Measured

LAST = "2-0.json"
"""The champion at which the process is killed."""
JUDGE = measures._evaluate


def evaluate(
    creature: Path, grounds: Sequence[str], examine: bool, champion: Path, finite: bool
) -> Measured:
    """Stand-in for `measures._evaluate`: killed once, when another champion's result is stored."""
    measures.SECONDS, study = 1.0, creature.parent
    killed = study.with_name(f"{study.name}-was-killed")
    if champion.name == LAST and not killed.exists():
        killed.touch()
        measured, until = study / measures.MEASURED, time.monotonic() + 60
        while not measured.exists() or measured.read_bytes().count(b"\n") < 1:
            assert time.monotonic() < until
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGKILL)
    return JUDGE(creature, grounds, examine, champion, finite)
