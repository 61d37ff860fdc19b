"""Cost of a generation besides the simulations: genetic operators and the host's bookkeeping."""

import dataclasses
import io
import tempfile
import threading
import time
from pathlib import Path
from statistics import median
from typing import Any

import jax
import jax.numpy as jnp
from rich.console import Console

from mjxgait.bench.ours import Ours
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.training import loop
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.examination import Examiner
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Experiment
from mjxgait.training.folder import EXAMS
from mjxgait.training.generation import evolution_of
from mjxgait.training.screen import Screen
from mjxgait.types import Judged

REPEATS = 30


def overhead(ours: Ours, generations: int = 8) -> dict[str, float]:
    """Return the seconds per generation and the shares of its parts.

    Parts: the operators, within the compiled program; on the host, the checkpoint, and all else
    (metrics, champion, screen).
    """
    operators = _operators(ours.experiment)
    whole, compiled, checkpoint = _host_loop(ours, generations)
    parts = {"operators": operators, "checkpoint": checkpoint, "log": whole - compiled - checkpoint}
    shares = {f"{name}_share": seconds / whole for name, seconds in parts.items()}
    return {
        "generation_s": whole,
        **{f"{name}_s": seconds for name, seconds in parts.items()},
        **shares,
    }


def _operators(experiment: Experiment) -> float:
    """Time a generation with an evaluator that returns at once."""
    task, count = experiment.simulator.task, experiment.config.evolution.offspring
    trials = experiment.config.rollout.starts

    def stub(genomes: Any) -> Judged:
        terms = jnp.mean(genomes.key_poses, axis=(1, 2))[:, None, None] * jnp.ones(
            (1, trials, len(task.terms))
        )
        outcome = jnp.zeros((count, trials, len(task.outcomes)))
        failed = jnp.zeros((count, trials), bool)
        return Judged(terms, outcome, failed, jnp.int32(1), jnp.int32(1))

    evolution = evolution_of(experiment.simulator, experiment.row.settings)

    @jax.jit
    def step(state: EvolutionState) -> tuple[EvolutionState, GenerationMetrics]:
        proposal = evolution.propose(state)
        return evolution.absorb(state, proposal, stub(proposal.offspring))

    state, _ = step(experiment.init())
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        state, _ = jax.block_until_ready(step(state))
        times.append(time.perf_counter() - began)
    return median(times)


class _TimedCheckpoints(Checkpoints):
    """Checkpoints that time how long saving holds up the run, background writing excluded."""

    seconds = 0.0

    def save(self, *args: Any) -> None:
        began = time.perf_counter()
        super().save(*args)
        self.seconds += time.perf_counter() - began


def _host_loop(ours: Ours, generations: int) -> tuple[float, float, float]:
    """Return seconds per generation of a run's own loop: in all, compiled part, checkpoints."""
    inside: list[float] = []

    def step(state: EvolutionState) -> Any:
        began = time.perf_counter()
        result = jax.block_until_ready(ours.step(state))
        inside.append(time.perf_counter() - began)
        return result

    config = ours.experiment.config
    config = dataclasses.replace(
        config,
        evolution=dataclasses.replace(config.evolution, generations=generations),
        examination=dataclasses.replace(config.examination, every=0),
    )
    experiment = dataclasses.replace(ours.experiment, config=config)
    with tempfile.TemporaryDirectory() as folder:
        checkpoints = _TimedCheckpoints(Path(folder), experiment.config.keep_every)
        screen = Screen(Console(file=io.StringIO()))
        began = time.perf_counter()
        loop._evolve(
            Path(folder),
            Examiner(experiment, {}, screen.say, Exams(Path(folder) / EXAMS)),
            step,
            ours.first,
            checkpoints,
            screen,
            threading.Event(),
        )
        whole = time.perf_counter() - began
        screen.close()
        checkpoints.close()
    return whole / len(inside), sum(inside) / len(inside), checkpoints.seconds / len(inside)
