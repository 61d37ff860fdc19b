"""Programs written by hand: read from a file and merged into the settings of a run."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from mjxgait.champion import Champion
from mjxgait.config.schema import Config
from mjxgait.config.tables import build, merge
from mjxgait.controllers.expressions.config import MOST_NODES, ProgramConfig
from mjxgait.controllers.expressions.parse import Vocabulary, read_programs
from mjxgait.controllers.expressions.serialize import (
    program_text,
    programs_to_begin_with,
    vocabulary,
)
from mjxgait.controllers.expressions.text import EMPTY, terminals
from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.files import read_text
from mjxgait.plugins.registry import find

Program = tuple[np.ndarray, np.ndarray]
"""Arrays code and value [J, C] of a program."""


def with_expressions(creature: Creature, config: Config, file: Path) -> Config:
    """Return the settings of a run with a file's programs at the start of the first generation.

    The settings hold the programs themselves, so the run folder needs no other file.

    Raises:
      UserError: names the file and the line of a mistake.
    """
    if config.use.controller != "program":
        raise UserError(
            f"--expressions {file}: is for the controller of expressions, and this is "
            f"{config.use.controller}; take --controller program"
        )
    settings = _settings(config)
    limits = vocabulary(creature, settings, senses_added(config), settings.depth)
    programs = programs_in(creature, file, limits)
    texts = [program_text(creature, program) for program in programs]
    table = merge(dataclasses.asdict(config), {"controller": {"expressions": texts}})
    given = build(type(config), table, str(file))
    _check_count(given, str(file), len(programs))
    return given


def written_champion(creature: Creature, config: Config, file: Path) -> Champion:
    """Return the program of a file as a champion without a run.

    It may use all functions and observations.

    Raises:
      UserError: names the file and the line of a mistake; or the file holds several programs.
    """
    known = terminals(creature, senses_added(config))
    programs = programs_in(creature, file, Vocabulary(known, MOST_NODES))
    if len(programs) > 1:
        raise UserError(f"{file}: holds {len(programs)} programs; leave the one to examine in it")
    code, value = programs[0]
    # The array length of a run, so that the same program has the same fingerprint.
    places = max(_settings(config).nodes, int((code != EMPTY).sum(1).max()))
    genome = {"code": code[:, :places], "value": value[:, :places]}
    return Champion.of(creature, config, genome, fitness=0.0, terms={}, origin={})


def programs_in(creature: Creature, file: Path, limits: Vocabulary) -> list[Program]:
    """Return the programs of a file, under these limits.

    Raises:
      UserError: names the file, and the line of a mistake.
    """
    return read_programs(read_text(file), creature.joints.names, limits, str(file))


def check_programs(creature: Creature, config: Config) -> None:
    """Refuse settings of the controller `program` with invalid or too many programs.

    Raises:
      UserError: names the problem and its remedy.
    """
    settings = _settings(config)
    if not settings.expressions:
        return
    given = programs_to_begin_with(creature, settings, senses_added(config), settings.depth)
    _check_count(config, "controller.expressions", 0 if given is None else len(given[0]))


def senses_added(config: Config) -> Sequence[str]:
    """Return the names of the observations that the task of a config adds."""
    return tuple(getattr(find("task", config.use.task), "adds", ()))


def _settings(config: Config) -> ProgramConfig:
    """Return the settings of the controller `program`."""
    settings: Any = config.controller
    return cast(ProgramConfig, settings)


def _check_count(config: Config, where: str, count: int) -> None:
    if count > config.evolution.population:
        raise UserError(
            f"{where}: {count} programs, and a population of {config.evolution.population}; take "
            f"--population {count} or more"
        )
