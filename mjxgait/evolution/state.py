"""What evolution carries from generation to generation, tells of one, and when it is over."""

from enum import IntEnum
from typing import Any

import jax

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.types import pytree

NOBODY = -1
"""The mother's place of one that has none, or of whom it is not known."""


class Origin(IntEnum):
    """How an individual came to be."""

    INITIAL = 0
    CROSSOVER = 1
    MUTATION = 2
    NEWCOMER = 3


@pytree
class EvolutionState:
    """Everything that the next generation reads. The population is sorted, best first, once it has
    been judged.

    genomes: leaves [P, ...]. terms: [P, R, F]. outcome: [P, R, O]. fitness: [P]. born: [P] generation of birth. origin: [P] an `Origin`.
    key: of all coming randomness. generation: [] -1 while seeding. seeded: [] how many of the initial population have been judged.
    best_history, mean_history: [W] of the latest generations, newest last. quiet: [] generations since the last spell.
    forced: [] whether the next generation is forced. spell_age, refreshed: [] of the current spell.
    spell_best: [] best fitness when the last spell began. barren: [] spells in a row that began
    without a better best than the one before.
    rounds: [P] of which `terms` is the mean; None where nobody's earlier rounds count.
    level: [] how often the trials have become harder; None where they never do.
    stale: [] whether they have since `terms` were judged; None likewise.
    family: [P] who of the first generation is the first of their mothers; None where a family may
    be of any size.
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
    """What there is to tell of a generation; scalars but for best_terms [F] and best_outcome [O],
    the mean over the trials of the best individual's terms and outcome.

    unique: different genomes. spread: mean standard deviation of a gene. failures: how many of the
    offspring's episodes ended early. mothers: [P] the places that the population, or its mothers,
    had in the generation before; None where that is not followed. level: of the next generation's
    trials; None where they never become harder.
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
    """What a generation wants judged.

    key: of the next generation. offspring: leaves [M, ...]; origin, born: [M]. mothers: [M] places
    of their first parents, or `NOBODY`; None where that is not followed.
    """

    key: jax.Array
    offspring: Any
    origin: jax.Array
    born: jax.Array
    mothers: jax.Array | None = None


def stop_reason(state: EvolutionState, config: EvolutionConfig) -> str | None:
    """Why a run is over after this generation, in words; None while it goes on.

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
