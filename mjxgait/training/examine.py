"""Runs that have come to their last generation: one of the best few of each with its certificate."""

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
    """Leaves champion and certificate in each of these run folders that has none, one per core;
    whether all have been looked at.

    folder: that they lie in. again: the command that goes on. tell: called with how many are done,
    and of how many.

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
    """Make a process ready: devices, and the code that was loaded in this one."""
    prepare_devices()
    load_all(own)


def _examine(folder: Path) -> None:
    """In a process of its own: all that is sent is the folder of a run."""
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
