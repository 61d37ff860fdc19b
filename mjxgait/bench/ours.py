"""This project as a contestant: a run's compiled generation, with genetic algorithm and fitness."""

import dataclasses
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.bench.workload import Lap, Workload
from mjxgait.config.schema import Config
from mjxgait.controllers.key_poses.controller import TUNING, Genome
from mjxgait.creature import load_creature
from mjxgait.evolution.state import EvolutionState
from mjxgait.training.devices import prepare_devices
from mjxgait.training.experiment import Experiment, build_experiment
from mjxgait.training.generation import next_starts


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
                "laps need growth = 2: as many are judged in a generation as there are in the "
                "population"
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
