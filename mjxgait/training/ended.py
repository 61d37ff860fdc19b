"""Check for finished runs from their folders alone; compiles and simulates nothing."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import cast

from mjxgait.certification import judged, outdated, read_certificate
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.evolution.state import EvolutionState, stop_reason
from mjxgait.training.examination import due, why_ended
from mjxgait.training.folder import CERTIFICATE, kept_champion
from mjxgait.training.own import command
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
    return f"{run}: nothing is left to do: {reason}. {_onward(run, config, stored)}"


def _stopped(config: Config, stored: Stored) -> str | None:
    """Return why evolution stops; with islands, failed forced phases end no run."""
    evolution = config.evolution
    if evolution.islands.count > 1:
        forced = dataclasses.replace(evolution.forced, patience=0)
        evolution = dataclasses.replace(evolution, forced=forced)
    state = cast(EvolutionState, SimpleNamespace(**stored.arrays))
    return stop_reason(state, evolution)


def _certified(run: Path, creature: Creature, config: Config, stored: Stored) -> str | None:
    """Return the reason if a passed early examination ended the run at this checkpoint."""
    generation = stored.manifest.generation
    if generation != stored_generations(run)[-1] or not due(config.examination, generation):
        return None
    try:
        document = read_certificate(run / CERTIFICATE)
        if document is None or outdated(document, kept_champion(run, creature), creature):
            return None
    except UserError:
        return None
    verdict = judged(document)
    return why_ended(generation, verdict.margin) if verdict.certified else None


def _examined(run: Path, creature: Creature, config: Config) -> bool:
    """Return whether the champion exists, with its certificate if the settings require one."""
    try:
        champion = kept_champion(run, creature)
        document = read_certificate(run / CERTIFICATE)
    except UserError:
        return False
    if document is None:
        return config.examination.candidates == 0
    return outdated(document, champion, creature) is None


def _onward(run: Path, config: Config, stored: Stored) -> str:
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
