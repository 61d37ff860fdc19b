"""What equals in many trainings, made once per process: simulators, predictions, fitness curves."""

import functools
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.certification.feasibility import Feasibility, feasibility
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.rendering.curves import Lines, plot_fitness
from mjxgait.training.experiment import program_key
from mjxgait.training.logs import columns
from mjxgait.training.simulator import SimulatorSpec
from mjxgait.training.spec import make_spec

DRAWN = ("generation", "best", "mean", "lower_quartile", "upper_quartile", "forced")
"""Columns of a log that the fitness curve shows."""
_KNOWN: dict[Hashable, Any] = {}


def _once(key: Hashable, make: Callable[[], Any]) -> Any:
    if key not in _KNOWN:
        _KNOWN[key] = make()
    return _KNOWN[key]


def spec_made_once(creature: Creature, config: Config) -> SimulatorSpec:
    """Stand in for `make_spec`: runs with equal programs share one, as in `Programs`.

    So the program of the first state is traced and loaded once.
    """
    return _once(program_key(creature, config), functools.partial(make_spec, creature, config))


def predicted_once(creature: Creature) -> Feasibility:
    """Stand in for `feasibility`: all bodies here follow from their files alone."""
    return _once(creature.digest, functools.partial(feasibility, creature))


def curve_drawn_once(lines: Lines, path: Path) -> None:
    """Stand in for `plot_fitness`: equal curves are one drawing."""
    column = columns(lines)
    shown = np.array([column[name] for name in DRAWN])

    def draw() -> bytes:
        plot_fitness(lines, path)
        return path.read_bytes()

    path.write_bytes(_once(shown.tobytes(), draw))
