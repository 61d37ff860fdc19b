"""Successive generations of runs side by side, and the log lines of each."""

import dataclasses
import functools
import importlib.metadata
import platform
import time
from collections.abc import Mapping, Sequence

import jax
import numpy as np

from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.tasks.base import Task
from mjxgait.training.experiment import Batch, Step, row_of
from mjxgait.training.logs import PARENTS, Line


class Generations:
    """Generations of a batch, one at a time.

    Attributes:
      states: after the latest generation, leaves [B, ...] on all devices.
      generation: of the row that is furthest.
      seconds: of all generations so far. steps: useful creature-steps in them.
    """

    def __init__(self, step: Step, batch: Batch, states: EvolutionState) -> None:
        self._step, self._batch = step, batch
        self.states = batch.place(states)
        self.generation = int(np.max(jax.device_get(states.generation)))
        self.seconds, self.steps = 0.0, 0

    def advance(self) -> list[Line]:
        """Run one generation; return a line for each row, or none.

        There is none before the whole first population is evaluated.
        """
        began = time.perf_counter()
        self.states, found = self._step(self.states)
        metrics: GenerationMetrics = jax.device_get(found)
        seconds = time.perf_counter() - began
        self.seconds += seconds
        self.generation = int(np.max(metrics.generation))
        if self.generation < 0:
            return []
        self.steps += int(metrics.sim_steps.sum())
        genomes = jax.device_get(self.states.genomes)
        return [
            metrics_line(row_of(metrics, row), seconds, one.simulator.task)
            | followed(one.simulator.controller.genome_statistics(row_of(genomes, row)))
            for row, one in enumerate(self._batch.experiments)
        ]

    def row(self, row: int = 0) -> EvolutionState:
        """Return the state of one row."""
        # Of arrays on this side of the device, where a row costs no program of its own.
        return row_of(jax.device_get(self.states), row)


def metrics_line(metrics: GenerationMetrics, seconds: float, task: Task) -> Line:
    """Return the line of `metrics.jsonl` for a generation; non-finite numbers become null."""
    line = {
        field.name: getattr(metrics, field.name).item()
        for field in dataclasses.fields(metrics)
        if getattr(metrics, field.name) is not None and not getattr(metrics, field.name).ndim
    }
    line["forced"] = bool(line["forced"])
    line |= {"steps_per_second": round(line["sim_steps"] / seconds), "wall_s": round(seconds, 4)}
    line |= _named("term", task.terms, metrics.best_terms)
    line |= _named("outcome", task.outcomes, metrics.best_outcome)
    finite = {key: value if np.isfinite(value) else None for key, value in line.items()}
    parents = {name: getattr(metrics, name) for name in PARENTS}
    return finite | {name: found.tolist() for name, found in parents.items() if found is not None}


def followed(statistics: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return best and mean of each quantity [P] of a population that is sorted, best first."""
    best = {f"{name}_best": float(values[0]) for name, values in statistics.items()}
    return best | {f"{name}_mean": float(values.mean()) for name, values in statistics.items()}


def _named(kind: str, names: Sequence[str], values: jax.Array) -> dict[str, float]:
    """Return the numbers of a kind under their names in a log line."""
    return {f"{kind}_{name}": float(value) for name, value in zip(names, values, strict=True)}


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions of Python and the packages that determine a run's results."""
    packages = ("mjxgait", "jax", "jaxlib", "mujoco", "mujoco-mjx")
    return {"python": platform.python_version()} | {
        name: importlib.metadata.version(name) for name in packages
    }
