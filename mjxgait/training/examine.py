"""Examination of runs that have reached their last generation."""

import io
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from rich.console import Console

from mjxgait.cores import one_per_core
from mjxgait.plugins.user_code import load_all, loaded
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.devices import prepare_devices
from mjxgait.training.examination import Examiner
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import build_experiment
from mjxgait.training.folder import CERTIFICATE, EXAMS, open_run
from mjxgait.training.loop import conclude, versions
from mjxgait.training.prescreen import tryout_of
from mjxgait.training.screen import Screen


def examine(
    folder: Path,
    runs: Sequence[Path],
    again: str,
    tell: Callable[[int, int], object],
    stopped: Callable[[], bool],
) -> bool:
    """Write champion and certificate to each run folder without one; return whether all are done.

    Each core examines one run at a time.

    folder: contains the run folders. again: command that continues. tell: called with the number
    of runs done and their total.

    Raises:
      UserError: a process was killed from outside, or the folder cannot be written.
    """
    left = [run for run in runs if not (run / CERTIFICATE).is_file()]
    done = one_per_core(
        _examine,
        left,
        tell,
        folder=folder,
        again=again,
        prepare=partial(_prepare, loaded()),
        stopped=stopped,
    )
    return done is not None


def _prepare(own: Sequence[tuple[str, str]]) -> None:
    """Prepare a worker process: devices, and the user's code that this process loaded."""
    prepare_devices()
    load_all(own)


def _examine(folder: Path) -> None:
    """Examine one run in a worker process, which receives only the run folder."""
    creature, config = open_run(folder)
    experiment, store = build_experiment(creature, config), Checkpoints(folder, config.keep_every)
    try:
        state = store.restore(experiment.abstract(), creature.digest)
    finally:
        store.close()
    quiet = Screen(Console(file=io.StringIO()))
    examiner = Examiner(
        experiment, versions(), quiet.say, Exams(folder / EXAMS), tryout_of(experiment)
    )
    conclude(folder, creature, quiet, examiner.best(state))
