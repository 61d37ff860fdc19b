"""Forced evolution (Wilson): when it begins and ends, its offspring, and which of them it admits.

Letters: `P` population, `M` offspring, `W` window of generations.
"""

import dataclasses

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.evolution.state import EvolutionState, Origin, finite_mean
from mjxgait.evolution.variation import Variation
from mjxgait.types import choose


def with_forced_phase(whole: EvolutionConfig, state: EvolutionState) -> EvolutionState:
    """Begin a forced phase when best and mean stall over the window; end it when it is done."""
    config = whole.forced
    best, mean = state.fitness[0], finite_mean(state.fitness)
    bests, means = (
        jnp.append(state.best_history[1:], best),
        jnp.append(state.mean_history[1:], mean),
    )
    age = jnp.where(state.forced, state.spell_age + 1, 0)
    spent = (jnp.asarray(config.limit) > 0) & (age >= config.limit)
    ends = state.forced & (spent | (state.refreshed >= _room(whole)))
    quiet = jnp.where(state.forced | (state.generation <= 0), 0, state.quiet + 1)
    stalled = (quiet >= config.window) & ~_grown(bests, config.gain) & ~_grown(means, config.gain)
    begins = stalled & ~state.forced & config.enabled
    if state.normal is not None:  # an evolution strategy has no parents to mutate
        begins = jnp.zeros((), bool)
    first = ~jnp.isfinite(state.spell_best)
    pays = first | _grown(jnp.stack([state.spell_best, best]), config.gain)
    return dataclasses.replace(
        state,
        best_history=bests,
        mean_history=means,
        quiet=quiet,
        forced=begins | (state.forced & ~ends),
        spell_age=jnp.where(begins, 0, age).astype(jnp.int32),
        refreshed=jnp.where(begins, 0, state.refreshed).astype(jnp.int32),
        spell_best=jnp.where(begins, best, state.spell_best),
        barren=jnp.where(begins, jnp.where(pays, 0, state.barren + 1), state.barren).astype(
            jnp.int32
        ),
    )


def _grown(history: jax.Array, gain: jax.Array | float) -> jax.Array:
    return history[-1] - history[0] > gain * jnp.maximum(jnp.abs(history[0]), 1.0)


def forced_offspring(
    keys: jax.Array,
    config: EvolutionConfig,
    variation: Variation,
    state: EvolutionState,
    created: object,
) -> tuple[object, jax.Array, jax.Array]:
    """Return immigrants and repeatedly mutated genomes, origins, and the mutants' parents.

    keys: [1 + mutations]. created: genomes [M, ...] of which the immigrants are the first.
    """
    count = config.offspring
    newcomers = jnp.round(config.forced.newcomers * count)
    drawn = jax.random.randint(keys[0], (count,), 0, config.population)
    mutants = jax.tree.map(lambda leaf: leaf[drawn], state.genomes)

    def mutated(mutants: object, key: jax.Array) -> tuple[object, None]:
        return jax.vmap(variation.mutate)(jax.random.split(key, count), mutants), None

    mutants, _ = jax.lax.scan(mutated, mutants, keys[1:])
    is_new = jnp.arange(count) < newcomers
    genomes = choose(is_new, created, mutants)
    return genomes, jnp.where(is_new, int(Origin.NEWCOMER), int(Origin.MUTATION)), drawn


def admitted(
    config: EvolutionConfig, state: EvolutionState, fitness: jax.Array, candidates: jax.Array
) -> jax.Array:
    """Select the candidates [P + M] that a forced generation admits.

    These are fit enough, best first, up to the room left in the phase.
    """
    old = jnp.sort(fitness[: config.population])
    enough = old[
        jnp.floor(config.forced.accept * jnp.float32(config.population - 1)).astype(jnp.int32)
    ]
    fit = candidates & (fitness >= enough) & jnp.isfinite(fitness)
    place = jnp.argsort(jnp.argsort(jnp.where(fit, -fitness, jnp.inf), stable=True))
    return fit & (place < _room(config) - state.refreshed)


def _room(config: EvolutionConfig) -> jax.Array:
    return jnp.clip(
        jnp.round(config.forced.refresh * jnp.float32(config.population)),
        1,
        config.population - 1,
    )


def with_stagnation_reset(state: EvolutionState, now: jax.Array) -> EvolutionState:
    """Where now [], forget earlier growth: every individual's fitness has changed.

    The window then begins with the next generation, because this one's best is still a fitness of
    the old trials.
    """
    return dataclasses.replace(
        state,
        quiet=jnp.where(now, -1, state.quiet),
        barren=jnp.where(now, 0, state.barren),
        spell_best=jnp.where(now, -jnp.inf, state.spell_best),
    )
