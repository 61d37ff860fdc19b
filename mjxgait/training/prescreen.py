"""Pre-screening: the best of a population on many starts at once, in evolution's own physics.

The few starts of a generation predict robustness poorly, and C MuJoCo takes a hundred times as long
to test it. So candidates are validated there in the order of their results here.
"""

import dataclasses
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.certification import CertificateConfig
from mjxgait.certification.acceptance import AcceptanceCriteria, acceptance_of
from mjxgait.config.schema import Config
from mjxgait.evolution.state import EvolutionState
from mjxgait.tasks.starts import Starts
from mjxgait.training.experiment import Batch, Experiment, build_experiment
from mjxgait.training.stages import compiled

OTHER = 1_000_000
"""Added to a run's seed, for other starts than those of its generations."""
TOP_LEVEL = 10**6
"""Curriculum level above any task's highest, so that trials are as hard as they become."""


def tried_settings(config: Config) -> Config:
    """Return the settings of pre-screening: disturbances and duration as in the examination."""
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


class Prescreen:
    """Pre-screening of one run; its program is compiled at first use or in advance by `begin`."""

    def __init__(self, experiment: Experiment) -> None:
        self.run = experiment
        self._ahead: Future[jax.stages.Compiled] | None = None

    def begin(self) -> None:
        """Start to compile in the background."""
        pool = ThreadPoolExecutor(1)
        self._ahead = pool.submit(self._compile)
        pool.shutdown(wait=False)

    def shares(self, state: EvolutionState, ranks: list[int]) -> np.ndarray:
        """Return the share [N] of starts from which each of these individuals manages its task.

        ranks: at most `examination.candidates` of them.
        """
        program = self._program  # first: compiling makes the properties used below
        padded = np.resize(ranks, self.run.config.examination.candidates)
        genomes = jax.tree.map(lambda leaf: leaf[None, padded], state.genomes)
        numbers, rows = self._batch.known
        evaluation = program(numbers, rows.settings, self._starts, genomes)
        task, config = self._trials.simulator.task, self._trials.config
        outcome = np.asarray(evaluation.outcome)[0, : len(ranks), 1:]
        seconds, creature = config.rollout.seconds, self.run.creature
        managed = [
            self._demands.managed(dict(zip(task.outcomes, one.T, strict=True)), seconds, creature)
            for one in outcome
        ]
        return np.array([trials.mean() for trials in managed])

    def margin(self, share: float) -> float:
        """Return the margin of the disturbed-start criteria if C MuJoCo gave the same share."""
        criteria = self._demands.disturbed(share, 1.0, CertificateConfig())
        return min(criterion.margin for criterion in criteria)

    @property
    def _demands(self) -> AcceptanceCriteria:
        config = self.run.config
        return acceptance_of(config.use.task, config.wish)

    @cached_property
    def _trials(self) -> Experiment:
        return build_experiment(self.run.creature, tried_settings(self.run.config))

    @cached_property
    def _batch(self) -> Batch:
        return Batch((self._trials,))

    @cached_property
    def _starts(self) -> Starts:
        """Starts [1, R] of all candidates of the run, at the highest curriculum level."""
        row, task = self._trials.row, self._trials.simulator.task
        starts = row.starts
        if task.has_curriculum:
            starts = task.at_level(starts, row.settings.fitness, jnp.int32(TOP_LEVEL))
        return jax.tree.map(lambda leaf: leaf[None], starts)

    @cached_property
    def _program(self) -> jax.stages.Compiled:
        return self._compile() if self._ahead is None else self._ahead.result()

    def _compile(self) -> jax.stages.Compiled:
        count = self.run.config.examination.candidates

        def some(leaf: jax.ShapeDtypeStruct) -> jax.ShapeDtypeStruct:
            return jax.ShapeDtypeStruct((1, count, *leaf.shape[1:]), leaf.dtype)

        genomes = jax.tree.map(some, self._trials.abstract().genomes)
        return compiled(self._batch.lower_evaluate(genomes, self._starts))


def prescreen_of(experiment: Experiment) -> Prescreen | None:
    """Return the pre-screening of a run; None if its settings disable it."""
    settings = experiment.config.examination
    return Prescreen(experiment) if settings.tryout and settings.candidates else None
