"""What equals in many trainings, made once per process: simulators, predictions, fitness curves."""

from pathlib import Path

import numpy as np

from mjxgait.certification.feasibility import Feasibility, feasibility
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.lru import LruCache
from mjxgait.rendering.curves import Lines, plot_fitness
from mjxgait.training.experiment import program_key
from mjxgait.training.logs import columns
from mjxgait.training.simulator import SimulatorSpec
from mjxgait.training.spec import make_spec

DRAWN = ("generation", "best", "mean", "lower_quartile", "upper_quartile", "forced")
"""Columns of a log that the fitness curve shows."""
KEPT = 99
"""More than there are."""
SPECS: LruCache[SimulatorSpec] = LruCache(KEPT)
PREDICTIONS: LruCache[Feasibility] = LruCache(KEPT)
CURVES: LruCache[bytes] = LruCache(KEPT)


def spec_made_once(creature: Creature, config: Config) -> SimulatorSpec:
    """Stand in for `make_spec`: runs with equal programs share one, as in `Programs`.

    So the program of the first state is traced and loaded once.
    """
    return SPECS.find(program_key(creature, config), lambda: make_spec(creature, config))


def predicted_once(creature: Creature) -> Feasibility:
    """Stand in for `feasibility`: all bodies here follow from their files alone."""
    return PREDICTIONS.find(creature.digest, lambda: feasibility(creature))


def curve_drawn_once(lines: Lines, path: Path, subject: str) -> None:
    """Stand in for `plot_fitness`: equal curves are one drawing."""
    column = columns(lines)
    shown = np.array([column[name] for name in DRAWN])

    def draw() -> bytes:
        plot_fitness(lines, path, subject)
        return path.read_bytes()

    path.write_bytes(CURVES.find(subject.encode() + shown.tobytes(), draw))
