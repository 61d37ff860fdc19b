"""The genetic algorithm: one generation as a pure function of its state, whatever a genome drives.

A run begins with a population that nobody has judged (`seeding`): the first call judges it, so that
the physics is traced and compiled once. Forced evolution (Wilson) is another way to fill the same
offspring slots, chosen by a flag in the state.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from mjxgait.search.breeding import Nursery, parents
from mjxgait.search.state import EvolutionState, GenerationMetrics, Origin, Proposal
from mjxgait.search.variation import Variation, first_occurrence
from mjxgait.settings.config import EvolutionConfig
from mjxgait.settings.traced import chosen
from mjxgait.types import Judged


@dataclasses.dataclass(frozen=True, eq=False)
class Evolution:
    """The algorithm with its parts, around whoever judges: `propose`, then `absorb` the verdict.

    config: plain or traced. rank: terms [..., R, F], generation [] -> fitness [...], higher is
    better.
    """

    config: EvolutionConfig
    variation: Variation
    rank: Callable[[jax.Array, jax.Array], jax.Array]

    def init(self, key: jax.Array, trials: int, terms: int, outcomes: int) -> EvolutionState:
        """The state before anybody has been judged. trials, terms, outcomes: R, F, O."""
        key, key_create = jax.random.split(key)
        count, window = self.config.population, self.config.forced.window
        integer = jnp.zeros((), jnp.int32)
        return EvolutionState(
            genomes=self.variation.create(key_create, count),
            terms=jnp.zeros((count, trials, terms)),
            outcome=jnp.zeros((count, trials, outcomes)),
            fitness=jnp.full(count, -jnp.inf, jnp.float32),
            born=jnp.zeros(count, jnp.int32),
            origin=jnp.full(count, int(Origin.INITIAL), jnp.int32),
            key=key,
            generation=jnp.int32(-1),
            seeded=integer,
            best_history=jnp.full(window + 1, -jnp.inf, jnp.float32),
            mean_history=jnp.full(window + 1, -jnp.inf, jnp.float32),
            quiet=integer,
            forced=jnp.zeros((), bool),
            spell_age=integer,
            refreshed=integer,
            spell_best=jnp.float32(-jnp.inf),
            barren=integer,
        )

    def propose(self, state: EvolutionState) -> Proposal:
        """The offspring of a generation."""
        key, key_offspring = jax.random.split(state.key)
        offspring, origin = self._offspring(key_offspring, state, self._seeding(state))
        born = jnp.full(self.config.offspring, state.generation + 1)
        return self._with_elite(state, Proposal(key, offspring, origin, born))

    def _with_elite(self, state: EvolutionState, proposal: Proposal) -> Proposal:
        """With the best parents in the first places, to be judged once more."""
        count = self.config.elite
        if not count:
            return proposal

        def kept(leaf: jax.Array, old: jax.Array) -> jax.Array:
            first = jnp.where(self._seeding(state), leaf[:count], old[:count])
            return leaf.at[:count].set(first)

        return dataclasses.replace(
            proposal,
            offspring=jax.tree.map(kept, proposal.offspring, state.genomes),
            origin=kept(proposal.origin, state.origin),
            born=kept(proposal.born, state.born),
        )

    def absorb(
        self, state: EvolutionState, proposal: Proposal, judged: Judged
    ) -> tuple[EvolutionState, GenerationMetrics]:
        """The rest of a generation: survival, and the decision whether the next one is forced."""
        seeding = self._seeding(state)
        generation = jnp.where(seeding, jnp.where(self._filled(state), 0, -1), state.generation + 1)
        grown = self._survive(state, proposal, judged, generation)
        planted = self._plant(state, judged, generation)
        state = jax.tree.map(
            lambda a, b: jnp.where(seeding, a, b), _without_key(planted), _without_key(grown)
        )
        forced = state.forced
        state = self._decide(dataclasses.replace(state, key=proposal.key, generation=generation))
        return state, self._metrics(state, judged, forced)

    def _seeding(self, state: EvolutionState) -> jax.Array:
        return state.seeded < self.config.population

    def _filled(self, state: EvolutionState) -> jax.Array:
        return state.seeded + self.config.offspring >= self.config.population

    def _offspring(
        self, key: jax.Array, state: EvolutionState, seeding: jax.Array
    ) -> tuple[Any, jax.Array]:
        """Genomes [M, ...] and their origins [M]: the unjudged initial population, forced ones,
        or children.
        """
        key_children, key_forced = jax.random.split(key)
        places = state.seeded + jnp.arange(self.config.offspring)
        initial = jax.tree.map(lambda leaf: leaf[places % self.config.population], state.genomes)
        children, child_origin = self._children(key_children, state)
        forced, forced_origin = self._forced(key_forced, state)

        def pick(first: jax.Array, second: jax.Array, third: jax.Array) -> jax.Array:
            return jnp.where(seeding, first, jnp.where(state.forced, second, third))

        return jax.tree.map(pick, initial, forced, children), pick(
            jnp.zeros_like(child_origin), forced_origin, child_origin
        )

    def _children(self, key: jax.Array, state: EvolutionState) -> tuple[Any, jax.Array]:
        config, count = self.config, self.config.offspring
        if config.pool == "growing" or config.unique_children:
            bred, of_two = Nursery(config, self.variation).children(key, state.genomes)
            return bred, jnp.where(of_two, int(Origin.CROSSOVER), int(Origin.MUTATION))
        key_parents, key_cross, key_whether, key_mutate, key_mutated = jax.random.split(key, 5)
        mothers, fathers = parents(
            key_parents, count, config.population, config.selection, config.rivals
        )
        mother, father = (
            jax.tree.map(lambda leaf, i=i: leaf[i], state.genomes) for i in (mothers, fathers)
        )
        crossed = jax.vmap(self.variation.cross)(jax.random.split(key_cross, count), mother, father)
        crosses = jax.random.bernoulli(key_whether, config.crossover, (count,))
        child = _pick(crosses, crossed, mother)
        mutated = jax.vmap(self.variation.mutate)(jax.random.split(key_mutate, count), child)
        # A child of one parent that is not mutated would be a duplicate, unless the algorithm knows
        # no mutation at all.
        mutates = jax.random.bernoulli(key_mutated, config.mutation_rate, (count,)) | (
            ~crosses & (config.mutation_rate > 0)
        )
        origin = jnp.where(crosses, int(Origin.CROSSOVER), int(Origin.MUTATION))
        return _pick(mutates, mutated, child), origin

    def _forced(self, key: jax.Array, state: EvolutionState) -> tuple[Any, jax.Array]:
        config, count = self.config.forced, self.config.offspring
        keys = jax.random.split(key, 2 + config.mutations)
        key_create, key_parents = keys[0], keys[1]
        newcomers = jnp.round(config.newcomers * count)
        drawn = jax.random.randint(key_parents, (count,), 0, self.config.population)
        mutants = jax.tree.map(lambda leaf: leaf[drawn], state.genomes)

        def mutated(mutants: Any, key: jax.Array) -> tuple[Any, None]:
            return jax.vmap(self.variation.mutate)(jax.random.split(key, count), mutants), None

        mutants, _ = jax.lax.scan(mutated, mutants, keys[2:])
        is_new = jnp.arange(count) < newcomers
        created = self.variation.create(key_create, count)
        return _pick(is_new, created, mutants), jnp.where(
            is_new, int(Origin.NEWCOMER), int(Origin.MUTATION)
        )

    def _plant(
        self, state: EvolutionState, judged: Judged, generation: jax.Array
    ) -> EvolutionState:
        """The initial population with the verdict on its next members in their places."""
        places = state.seeded + jnp.arange(self.config.offspring)
        terms = state.terms.at[places].set(judged.terms, mode="drop")
        outcome = state.outcome.at[places].set(judged.outcome, mode="drop")
        seeded = jnp.minimum(state.seeded + self.config.offspring, self.config.population)
        known = jnp.arange(self.config.population) < seeded
        fitness = jnp.where(known, self.rank(terms, jnp.maximum(generation, 0)), -jnp.inf)
        order = jnp.where(
            self._filled(state),
            jnp.argsort(-fitness, stable=True),
            jnp.arange(self.config.population),
        )
        planted = dataclasses.replace(
            state, terms=terms, outcome=outcome, fitness=fitness, seeded=seeded
        )
        return _reordered(planted, order)

    def _survive(
        self, state: EvolutionState, proposal: Proposal, judged: Judged, generation: jax.Array
    ) -> EvolutionState:
        """The P best of the grown population, without duplicates; in a forced generation what
        was fit enough goes before the old.
        """
        count = self.config.population
        pool = jax.tree.map(
            lambda a, b: jnp.concatenate([a, b]),
            (state.genomes, state.terms, state.outcome, state.born, state.origin),
            (proposal.offspring, judged.terms, judged.outcome, proposal.born, proposal.origin),
        )
        fitness = self.rank(pool[1], generation)
        fresh = jnp.arange(fitness.shape[0]) >= count
        first = first_occurrence(pool[0])
        if self.config.elite:  # one that is judged once more is like its old self
            first = jnp.append(jnp.zeros(count, bool), first_occurrence(proposal.offspring))
        distinct = first | jnp.logical_not(self.config.remove_duplicates)
        admitted = self._admitted(state, fitness, fresh & distinct)
        lives = distinct & (fresh | chosen(self.config.survival, "best"))
        tier = jnp.where(state.forced & fresh, jnp.where(admitted, 2, 0), jnp.where(lives, 1, 0))
        if not self.config.elite:  # the best is never lost, whatever the tiers say
            best = jnp.arange(fitness.shape[0]) == jnp.argmax(fitness)
            tier = jnp.where(best & distinct, 3, tier)
        kept = jnp.lexsort((-fitness, -tier))[:count]
        kept = kept[jnp.argsort(-fitness[kept], stable=True)]
        genomes, terms, outcome, born, origin = jax.tree.map(lambda leaf: leaf[kept], pool)
        refreshed = state.refreshed + jnp.where(state.forced, jnp.sum(admitted), 0)
        return dataclasses.replace(
            state,
            genomes=genomes,
            terms=terms,
            outcome=outcome,
            born=born,
            origin=origin,
            fitness=fitness[kept],
            refreshed=refreshed.astype(jnp.int32),
        )

    def _admitted(
        self, state: EvolutionState, fitness: jax.Array, candidates: jax.Array
    ) -> jax.Array:
        """Which of the candidates [P + M] a forced generation takes in: fit enough, best first,
        as many as the spell has room for.
        """
        old = jnp.sort(fitness[: self.config.population])
        enough = old[
            jnp.floor(self.config.forced.accept * jnp.float32(self.config.population - 1)).astype(
                jnp.int32
            )
        ]
        fit = candidates & (fitness >= enough) & jnp.isfinite(fitness)
        place = jnp.argsort(jnp.argsort(jnp.where(fit, -fitness, jnp.inf), stable=True))
        return fit & (place < self._room() - state.refreshed)

    def _room(self) -> jax.Array:
        return jnp.clip(
            jnp.round(self.config.forced.refresh * jnp.float32(self.config.population)),
            1,
            self.config.population - 1,
        )

    def _decide(self, state: EvolutionState) -> EvolutionState:
        """Begins a spell of forced evolution when best and mean have stalled over the window;
        ends it when it has done its work.
        """
        config = self.config.forced
        best, mean = state.fitness[0], _finite_mean(state.fitness)
        bests, means = (
            jnp.append(state.best_history[1:], best),
            jnp.append(state.mean_history[1:], mean),
        )
        age = jnp.where(state.forced, state.spell_age + 1, 0)
        spent = (jnp.asarray(config.limit) > 0) & (age >= config.limit)
        ends = state.forced & (spent | (state.refreshed >= self._room()))
        quiet = jnp.where(state.forced | (state.generation <= 0), 0, state.quiet + 1)
        stalled = (
            (quiet >= config.window) & ~_grown(bests, config.gain) & ~_grown(means, config.gain)
        )
        begins = stalled & ~state.forced & config.enabled
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

    def _metrics(
        self, state: EvolutionState, judged: Judged, forced: jax.Array
    ) -> GenerationMetrics:
        quartiles = jnp.percentile(
            jnp.where(jnp.isfinite(state.fitness), state.fitness, jnp.nan),
            jnp.array([25, 50, 75]),
            method="nearest",
        )
        spreads = [jnp.mean(jnp.std(leaf, axis=0)) for leaf in jax.tree.leaves(state.genomes)]
        return GenerationMetrics(
            generation=state.generation,
            best=state.fitness[0],
            mean=_finite_mean(state.fitness),
            median=quartiles[1],
            lower_quartile=quartiles[0],
            upper_quartile=quartiles[2],
            worst=state.fitness[-1],
            unique=jnp.sum(first_occurrence(state.genomes)),
            spread=sum(spreads, jnp.zeros(())) / len(spreads),
            forced=forced,
            failures=jnp.sum(judged.failed),
            episodes=jnp.int32(judged.failed.size),
            evaluations=jnp.int32(self.config.offspring),
            sim_steps=judged.sim_steps,
            computed_steps=judged.computed_steps,
            best_terms=jnp.mean(state.terms[0], axis=0),
            best_outcome=jnp.mean(state.outcome[0], axis=0),
        )


def _grown(history: jax.Array, gain: jax.Array | float) -> jax.Array:
    return history[-1] - history[0] > gain * jnp.maximum(jnp.abs(history[0]), 1.0)


def _finite_mean(values: jax.Array) -> jax.Array:
    finite = jnp.isfinite(values)
    return jnp.where(
        jnp.any(finite),
        jnp.sum(jnp.where(finite, values, 0.0)) / jnp.maximum(jnp.sum(finite), 1),
        -jnp.inf,
    )


def _pick(condition: jax.Array, yes: Any, no: Any) -> Any:
    """Row by row [M] from one or the other pytree of leaves [M, ...]."""
    return jax.tree.map(
        lambda a, b: jnp.where(condition.reshape(-1, *[1] * (a.ndim - 1)), a, b), yes, no
    )


def _reordered(state: EvolutionState, order: jax.Array) -> EvolutionState:
    names = ("genomes", "terms", "outcome", "fitness", "born", "origin")
    rows = {name: getattr(state, name) for name in names}
    return dataclasses.replace(state, **jax.tree.map(lambda leaf: leaf[order], rows))


def _without_key(state: EvolutionState) -> EvolutionState:
    """Typed keys cannot be chosen between with `where`; the caller sets the next one."""
    return dataclasses.replace(state, key=jnp.zeros(()))
