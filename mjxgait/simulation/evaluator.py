"""Evaluation of genomes: the one contract between evolution and a simulation backend."""

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Protocol

import jax
import jax.numpy as jnp

from mjxgait.config.schema import Config
from mjxgait.simulation.rollout import Episodes, Simulator
from mjxgait.tasks.base import EpisodeStats, in_order
from mjxgait.tasks.falls import Reason
from mjxgait.tasks.starts import Starts
from mjxgait.types import Evaluation, RequestedTrials, choose


class Evaluator(Protocol):
    """Evaluator of the genomes of several evolution runs, the rows `B`."""

    def evaluate(
        self,
        genomes: object,
        trials: Starts,
        settings: Config,
        requested: RequestedTrials | None = None,
    ) -> Evaluation:
        """Return the results, leaves [B, N, ...], of genomes [B, N, ...] in the trials [B, R].

        settings: traced, leaves [B, ...]. requested: the trials to run; None is all.
        """
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class LocalEvaluator:
    """Evaluator on this machine's devices, as a part of the program that calls it."""

    simulator: Simulator

    def evaluate(
        self,
        genomes: object,
        trials: Starts,
        settings: Config,
        requested: RequestedTrials | None = None,
    ) -> Evaluation:
        """Outside the simulations, each row reads only its own data."""
        wanted = None if requested is None else jnp.asarray(requested.wanted)
        episodes = self.simulator.simulate(genomes, trials, settings, wanted)
        lived = jnp.sum(episodes.stats.steps, axis=(1, 2))
        # Idle lanes belong to no row: each row is charged in proportion to its own steps.
        share = lived / jnp.maximum(jnp.sum(lived), 1)
        computed = jnp.round(episodes.computed_steps * share).astype(jnp.int32)

        def of_row(row: tuple[Config, EpisodeStats, jax.Array]) -> Evaluation:
            settings, stats, computed = row
            return self.evaluation_of(settings, Episodes(stats, computed))

        evaluation = jax.lax.map(of_row, (settings, episodes.stats, computed))
        return evaluation if requested is None else completed(evaluation, requested)

    def evaluation_of(self, settings: Config, episodes: Episodes) -> Evaluation:
        """Return the results of one row's episodes, statistics with leaves [N, R, ...]."""
        task, stats = self.simulator.task, episodes.stats

        def each(
            function: Callable[[EpisodeStats], Mapping[str, jax.Array]], names: tuple[str, ...]
        ) -> jax.Array:
            return jax.vmap(jax.vmap(lambda one: in_order(function(one), names)))(stats)

        terms = each(partial(task.evaluate, settings=settings.fitness), task.terms)
        return Evaluation(
            terms=jnp.where((stats.reason == Reason.NONFINITE)[..., None], jnp.nan, terms),
            outcome=each(task.outcome, task.outcomes),
            failed=stats.reason != Reason.FINISHED,
            sim_steps=jnp.sum(stats.steps),
            computed_steps=episodes.computed_steps,
        )


def completed(evaluation: Evaluation, requested: RequestedTrials) -> Evaluation:
    """Fill in the known results of the trials that were not run; all leaves [B, ...]."""
    wanted, known = requested.wanted, requested.known
    return Evaluation(
        terms=choose(wanted, evaluation.terms, known.terms),
        outcome=choose(wanted, evaluation.outcome, known.outcome),
        failed=choose(wanted, evaluation.failed, known.failed),
        sim_steps=evaluation.sim_steps + known.sim_steps,
        computed_steps=evaluation.computed_steps + known.computed_steps,
    )
