"""Runs that are over: whether one is, and the examination of its last generation."""

import dataclasses
import io
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import cast

from rich.console import Console

from mjxgait.certification import Lack, NoCertificate, ValidCertificate, certificate_state
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState, stop_reason
from mjxgait.plugins.user_code import load_all, loaded
from mjxgait.processes import one_per_core
from mjxgait.training.advance import versions
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.examination import Examiner, due, why_ended
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import build_experiment
from mjxgait.training.folder import CERTIFICATE, EXAMS, command, kept_champion, open_run
from mjxgait.training.loop import conclude
from mjxgait.training.prescreen import prescreen_of
from mjxgait.training.screen import Screen
from mjxgait.training.stages import prepare_devices
from mjxgait.training.stored import Stored, read_stored, stored_generations


def end_of(run: Path, creature: Creature, config: Config, stored: Stored) -> str | None:
    """Return why a run is over at one of its checkpoints; None if it goes on."""
    return _stopped(config, stored) or _certified(run, creature, config, stored)


def nothing_left(run: Path, creature: Creature, config: Config, kept: Config) -> str | None:
    """Return a message that a run is complete, with options that continue it; None if it is not.

    Args:
      config: settings to go on with. kept: those of the run folder. Changed examination settings
        are a reason to go on.

    Raises:
      UserError: the latest checkpoint is damaged or foreign.
    """
    if config.examination != kept.examination or not stored_generations(run):
        return None
    stored = read_stored(run, creature.digest)
    reason = end_of(run, creature, config, stored)
    if reason is None or not _examined(run, creature, config):
        return None
    return f"{run}: nothing is left to do: {reason}. {_to_continue(run, config, stored)}"


def _stopped(config: Config, stored: Stored) -> str | None:
    """Return why evolution stops; with islands, failed forced phases end no run."""
    evolution = config.evolution
    if evolution.islands.count > 1:
        evolution = evolution.patient()
    state = cast(EvolutionState, SimpleNamespace(**stored.arrays))
    return stop_reason(state, evolution)


def _certified(run: Path, creature: Creature, config: Config, stored: Stored) -> str | None:
    """Return the reason if a passed early examination ended the run at this checkpoint."""
    generation = stored.manifest.generation
    if generation != stored_generations(run)[-1] or not due(config.examination, generation):
        return None
    state = _state(run, creature)
    if not isinstance(state, ValidCertificate) or not state.verdict.certified:
        return None
    return why_ended(generation, state.verdict.margin)


def _examined(run: Path, creature: Creature, config: Config) -> bool:
    """Return whether the champion exists, with its certificate if the settings require one."""
    state = _state(run, creature)
    if isinstance(state, NoCertificate) and state.lack == Lack.MISSING:
        return config.examination.candidates == 0
    return isinstance(state, ValidCertificate)


def _state(run: Path, creature: Creature) -> ValidCertificate | NoCertificate | None:
    """Return what the certificate says of the run's champion; None without a champion."""
    try:
        champion = kept_champion(run, creature)
    except UserError:
        return None
    return certificate_state(run / CERTIFICATE, champion, creature)


def _to_continue(run: Path, config: Config, stored: Stored) -> str:
    """Return the command that continues a finished run, or advice if no option does."""
    generation, evolution = stored.manifest.generation, config.evolution
    endless = dataclasses.replace(evolution, target=None, generations=generation + 1)
    if _stopped(dataclasses.replace(config, evolution=endless), stored):
        return "No option goes on from there; a new run with another --seed may do better"
    options: list[object] = []
    if evolution.target is not None and stored.arrays["fitness"][0] >= evolution.target:
        options += ["--evolution.target", None]
    if generation >= evolution.generations:
        options += ["--generations", max(2 * generation, 1)]
    options = options or ["--examination.every", 0]
    return f"To go on: {command('train', '--resume', run, *options, run=run)}"


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
        experiment, versions(), quiet.say, Exams(folder / EXAMS), prescreen_of(experiment)
    )
    conclude(folder, creature, quiet, examiner.best(state))
