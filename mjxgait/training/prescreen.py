"""The best of a population on many starts at once, in evolution's own physics.

The few starts of a generation say little of who bears all of them, and C MuJoCo takes a hundred times
as long to find out. So those that are to be looked at there come in the order of what they do here.
"""

import dataclasses
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.certification import CertificateConfig
from mjxgait.certification.tasks import Demands, demands_of
from mjxgait.config.schema import Config
from mjxgait.evolution.state import EvolutionState
from mjxgait.tasks.starts import Starts
from mjxgait.training.devices import compiled
from mjxgait.training.experiment import Batch, Experiment, build_experiment

OTHER = 1_000_000
"""Added to a run's seed: other starts than those of its generations."""
HARDEST = 10**6
"""A level at which trials are as hard as they become."""


def tried_settings(config: Config) -> Config:
    """The settings of tryouts: starts as far disturbed, and episodes as long, as the examiner's."""
    exam = CertificateConfig()
    rollout = dataclasses.replace(
        config.rollout,
        starts=1 + config.examination.tryout,
        seconds=exam.seconds,
        variety=1,
        joint_noise=exam.starts.joints,
        velocity_noise=exam.starts.velocities,
        friction=exam.starts.friction,
        gains=exam.starts.gains,
        latency=exam.starts.latency,
    )
    return dataclasses.replace(config, seed=config.seed + OTHER, rollout=rollout)


class Tryout:
    """Of one run; its program is compiled when it is first asked for, or ahead of that."""

    def __init__(self, experiment: Experiment) -> None:
        self.run = experiment
        self._ahead: Future[jax.stages.Compiled] | None = None

    def begin(self) -> None:
        """Compiles beside whatever comes next."""
        pool = ThreadPoolExecutor(1)
        self._ahead = pool.submit(self._compile)
        pool.shutdown(wait=False)

    def shares(self, state: EvolutionState, ranks: list[int]) -> np.ndarray:
        """[N] share of the starts from which each of these individuals manages its task.

        ranks: at most as many as the settings have candidates.
        """
        program = self._program  # first: while it is being compiled ahead all below is being made
        padded = np.resize(ranks, self.run.config.examination.candidates)
        genomes = jax.tree.map(lambda leaf: leaf[None, padded], state.genomes)
        numbers, rows = self._batch.known
        judged = program(numbers, rows.settings, self._starts, genomes)
        task, config = self._trials.simulator.task, self._trials.config
        outcome = np.asarray(judged.outcome)[0, : len(ranks), 1:]
        seconds, creature = config.rollout.seconds, self.run.creature
        managed = [
            self._demands.managed(dict(zip(task.outcomes, one.T, strict=True)), seconds, creature)
            for one in outcome
        ]
        return np.array([trials.mean() for trials in managed])

    def margin(self, share: float) -> float:
        """That of the criteria which disturbed starts decide, if so many manage in C MuJoCo too."""
        criteria = self._demands.disturbed(share, 1.0, CertificateConfig())
        return min(criterion.margin for criterion in criteria)

    @property
    def _demands(self) -> Demands:
        config = self.run.config
        return demands_of(config.use.task, config.wish)

    @cached_property
    def _trials(self) -> Experiment:
        return build_experiment(self.run.creature, tried_settings(self.run.config))

    @cached_property
    def _batch(self) -> Batch:
        return Batch((self._trials,))

    @cached_property
    def _starts(self) -> Starts:
        """[1, R], the same for all whom the run tries, and as hard as its trials become."""
        row, task = self._trials.row, self._trials.simulator.task
        starts = row.starts
        if task.climbs:
            starts = task.harder(starts, row.settings.fitness, jnp.int32(HARDEST))
        return jax.tree.map(lambda leaf: leaf[None], starts)

    @cached_property
    def _program(self) -> jax.stages.Compiled:
        return self._compile() if self._ahead is None else self._ahead.result()

    def _compile(self) -> jax.stages.Compiled:
        count = self.run.config.examination.candidates

        def some(leaf: Any) -> Any:
            return jax.ShapeDtypeStruct((1, count, *leaf.shape[1:]), leaf.dtype)

        genomes = jax.tree.map(some, self._trials.abstract().genomes)
        return compiled(self._batch.lower_judge(genomes, self._starts))


def tryout_of(experiment: Experiment) -> Tryout | None:
    """Where the settings of a run want one."""
    settings = experiment.config.examination
    return Tryout(experiment) if settings.tryout and settings.candidates else None
