"""This project as a contestant: a run's compiled generation, with genetic algorithm and fitness."""

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
import numpy as np
from rich.console import Console

from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.controller import TUNING, Genome
from mjxgait.creature import load_creature
from mjxgait.evolution.state import EvolutionState, GenerationMetrics
from mjxgait.training import loop
from mjxgait.training.advance import Generations
from mjxgait.training.checkpoint import Checkpoints
from mjxgait.training.examination import Examiner
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Batch, Experiment, build_experiment, one_row, row_of
from mjxgait.training.folder import EXAMS
from mjxgait.training.generation import evolution_of, next_starts
from mjxgait.training.screen import Screen
from mjxgait.training.stages import prepare_devices
from mjxgait.types import Evaluation
from peers.workload import Lap, Workload


class Ours:
    """One creature's run.

    startup, compile: s. Laps evaluate the genomes given to `take`.
    """

    def __init__(self, folder: Path, config: Config) -> None:
        began = time.perf_counter()
        prepare_devices()
        self.folder, self.experiment = folder, build_experiment(load_creature(folder), config)
        self.first: EvolutionState = self.experiment.init()
        self.startup = time.perf_counter() - began
        began = time.perf_counter()
        self.step = self.experiment.compile()
        self.compile = time.perf_counter() - began
        self.first = self.experiment.place(self.first)

    def evolved(self, generations: int) -> EvolutionState:
        """Return the state after some generations."""
        state = self.first
        for _ in range(generations + 1):
            state, _ = self.step(state)
        return state

    def take(self, genomes: Genome) -> None:
        """Make these genomes [P] the population that laps evaluate; none is evaluated yet."""
        if (
            self.experiment.config.evolution.offspring
            != self.experiment.config.evolution.population
        ):
            raise ValueError(
                "laps need growth = 2: each generation must evaluate as many individuals "
                "as the population has"
            )
        self.first = self.experiment.place(dataclasses.replace(self.first, genomes=genomes))

    def lap(self) -> Lap:
        """Run one generation, which evaluates every individual on all starts."""
        began, worked = time.perf_counter(), time.process_time()
        state, metrics = jax.block_until_ready(self.step(self.first))
        seconds, processor = time.perf_counter() - began, time.process_time() - worked
        return Lap(seconds, int(metrics.sim_steps), self._mean_forward(state), processor)

    def _mean_forward(self, state: EvolutionState) -> float:
        """Return the mean distance forward over all episodes, in m."""
        place = self.experiment.simulator.task.outcomes.index("forward")
        return float(np.nanmean(np.asarray(state.outcome[..., place])))

    def useful_share(self) -> float:
        """Return the share of useful steps in the computed steps of a lap's generation."""
        _, metrics = self.step(self.first)
        return float(metrics.sim_steps) / float(metrics.computed_steps)


def half_and_half(ours: Ours, generations: int) -> Genome:
    """Join the better half of an evolved population with half of the initial one.

    So the workload has good walkers and early deaths.
    """
    half = ours.experiment.config.evolution.population // 2
    evolved, initial = ours.evolved(generations).genomes, ours.first.genomes
    return jax.tree.map(
        lambda a, b: jnp.concatenate([a[:half], b[: b.shape[0] - half]]), evolved, initial
    )


def as_workload(folder: Path, experiment: Experiment, state: EvolutionState) -> Workload:
    """Return in NumPy what the next generation of this state evaluates: its genomes on its starts.

    Where starts vary (`rollout.variety`) a run has many more; each generation takes some of them.
    """
    genomes = state.genomes
    starts = jax.device_get(next_starts(experiment.simulator.task, experiment.row, state))
    tuning = np.asarray(genomes.tuning, float)
    return Workload(
        folder=folder,
        config=experiment.config,
        key_poses=np.asarray(genomes.key_poses, float),
        tuning={name: tuning[:, i] for i, name in enumerate(TUNING)},
        qpos=np.asarray(starts.qpos, float),
        qvel=np.asarray(starts.qvel, float),
        friction=np.asarray(starts.friction, float),
        push=np.asarray(starts.push, float),
        push_step=np.asarray(starts.push_step),
        steps=experiment.simulator.steps,
    )


REPEATS = 30
GENERATIONS = 8
"""Generations of the run that times the loop on the host."""


def overhead(ours: Ours) -> dict[str, float]:
    """Return the seconds per generation and the shares of its parts.

    Parts: the operators, within the compiled program; on the host, the checkpoint, and all else
    (metrics, champion, screen).
    """
    operators = _operators(ours.experiment)
    whole, compiled, checkpoint = _host_loop(ours)
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

    def stub(genomes: Genome) -> Evaluation:
        terms = jnp.mean(genomes.key_poses, axis=(1, 2))[:, None, None] * jnp.ones(
            (1, trials, len(task.terms))
        )
        outcome = jnp.zeros((count, trials, len(task.outcomes)))
        failed = jnp.zeros((count, trials), bool)
        return Evaluation(terms, outcome, failed, jnp.int32(1), jnp.int32(1))

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


def _host_loop(ours: Ours) -> tuple[float, float, float]:
    """Return seconds per generation of a run's own loop: in all, compiled part, checkpoints."""
    inside: list[float] = []

    def step(states: EvolutionState) -> tuple[EvolutionState, GenerationMetrics]:
        began = time.perf_counter()
        result = jax.block_until_ready(one_row(ours.step(row_of(states))))
        inside.append(time.perf_counter() - began)
        return result

    config = ours.experiment.config
    config = dataclasses.replace(
        config,
        evolution=dataclasses.replace(config.evolution, generations=GENERATIONS),
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
            Generations(step, Batch((experiment,)), one_row(ours.first)),
            checkpoints,
            screen,
            threading.Event(),
        )
        whole = time.perf_counter() - began
        screen.close()
        checkpoints.close()
    return whole / len(inside), sum(inside) / len(inside), checkpoints.seconds / len(inside)
