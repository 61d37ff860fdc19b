"""Data that evolution carries between generations, metrics of one generation, and stop reasons."""

from enum import IntEnum
from typing import Any

import jax

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.types import pytree

NOBODY = -1
"""Mother's place of an individual without a mother, or with an unknown one."""


class Origin(IntEnum):
    """Origin of an individual."""

    INITIAL = 0
    CROSSOVER = 1
    MUTATION = 2
    NEWCOMER = 3


@pytree
class EvolutionState:
    """State that the next generation reads; the population is sorted, best first, once evaluated.

    genomes: leaves [P, ...]. terms: [P, R, F]. outcome: [P, R, O]. fitness: [P]. born: [P]
    generation of birth. origin: [P] an `Origin`.
    key: for all future random numbers. generation: [] -1 while seeding. seeded: [] number of the
    initial population evaluated so far.
    best_history, mean_history: [W] of the latest generations, newest last. quiet: [] generations
    since the last forced phase.
    forced: [] whether the next generation is forced. spell_age, refreshed: [] of the current phase.
    spell_best: [] best fitness when the last phase began. barren: [] phases in a row that began
    without a better best than the one before.
    rounds: [P] of which `terms` is the mean; None where earlier rounds do not count.
    level: [] number of times the trials have become harder; None without a curriculum.
    stale: [] whether they have since `terms` were evaluated; None likewise.
    family: [P] first-generation ancestor along the mothers; None where a lineage may be of any
    size.
    """

    genomes: Any
    terms: jax.Array
    outcome: jax.Array
    fitness: jax.Array
    born: jax.Array
    origin: jax.Array
    key: jax.Array
    generation: jax.Array
    seeded: jax.Array
    best_history: jax.Array
    mean_history: jax.Array
    quiet: jax.Array
    forced: jax.Array
    spell_age: jax.Array
    refreshed: jax.Array
    spell_best: jax.Array
    barren: jax.Array
    rounds: jax.Array | None = None
    level: jax.Array | None = None
    stale: jax.Array | None = None
    family: jax.Array | None = None


@pytree
class GenerationMetrics:
    """Metrics of a generation: scalars except best_terms [F] and best_outcome [O].

    best_terms, best_outcome: mean over the trials of the best individual. unique: different
    genomes. spread: mean standard deviation of a gene. failures: number of the offspring's episodes
    that ended early. mothers: [P] places of the population, or of its mothers, in the generation
    before; None where that is not recorded. level: of the next generation's trials; None without a
    curriculum.
    """

    generation: jax.Array
    best: jax.Array
    mean: jax.Array
    median: jax.Array
    lower_quartile: jax.Array
    upper_quartile: jax.Array
    worst: jax.Array
    unique: jax.Array
    spread: jax.Array
    forced: jax.Array
    failures: jax.Array
    episodes: jax.Array
    evaluations: jax.Array
    sim_steps: jax.Array
    computed_steps: jax.Array
    best_terms: jax.Array
    best_outcome: jax.Array
    mothers: jax.Array | None = None
    level: jax.Array | None = None


@pytree
class Proposal:
    """Offspring that a generation submits for evaluation.

    key: of the next generation. offspring: leaves [M, ...]; origin, born: [M]. mothers: [M] places
    of their first parents, or `NOBODY`; None where that is not recorded.
    """

    key: jax.Array
    offspring: Any
    origin: jax.Array
    born: jax.Array
    mothers: jax.Array | None = None


def stop_reason(state: EvolutionState, config: EvolutionConfig) -> str | None:
    """Explain in words why a run ends after this generation; None while it continues.

    Reads the state on the host.
    """
    if config.target is not None and float(state.fitness[0]) >= config.target:
        return f"the target fitness of {config.target:g} is reached"
    if (
        config.forced.enabled
        and config.forced.patience
        and int(state.barren) >= config.forced.patience
    ):
        return (
            f"forced evolution no longer pays: {int(state.barren)} spells in a row without growth"
        )
    if int(state.generation) >= config.generations:
        return f"all {config.generations} generations are done"
    return None
