"""Evolution: one generation as a pure function of its state, for any kind of genome.

The children are bred (`breeding.py`) or drawn from a distribution (`strategy.py`); all else is the
same for both. A run begins with a population that has not been evaluated (`seeding`). The first
call evaluates it, so that the physics is traced and compiled once. Forced evolution (Wilson) fills
the same offspring slots in another way, chosen by a flag in the state.
"""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.evolution.forced import forced_offspring, with_forced_phase
from mjxgait.evolution.offspring import Parents, children
from mjxgait.evolution.restart import with_restart
from mjxgait.evolution.state import (
    NO_PARENT,
    EvolutionState,
    GenerationMetrics,
    Origin,
    Proposal,
    metrics,
)
from mjxgait.evolution.strategy import Normal, SeparableCma
from mjxgait.evolution.survival import Survival, pooled, together
from mjxgait.evolution.variation import Variation
from mjxgait.types import Evaluation, Tree, choose


@dataclasses.dataclass(frozen=True, eq=False)
class Evolution:
    """Algorithm and its operators around the simulation: `propose`, then `absorb` the results.

    config: plain or traced. rank: terms [..., R, F], generation [] -> fitness [...], higher is
    better. hold: generations with the same opponent, where genomes have one.
    """

    config: EvolutionConfig
    variation: Variation
    rank: Callable[[jax.Array, jax.Array], jax.Array]
    hold: jax.Array | int = dataclasses.field(default=1, kw_only=True)

    def init(self, key: jax.Array, trials: int, terms: int, outcomes: int) -> EvolutionState:
        """Return the state before any evaluation. trials, terms, outcomes: R, F, O."""
        key, key_create = jax.random.split(key)
        count, window = self.config.population, self.config.forced.window
        integer = jnp.zeros((), jnp.int32)
        genomes, follows = self.variation.begin(key_create, count), self.config.follows
        return EvolutionState(
            genomes=genomes,
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
            rounds=jnp.ones(count) if self.config.remember else None,
            family=jnp.arange(count) if follows and self.config.family < 1 else None,
            normal=self._strategy.begun(genomes) if self.config.search == "es" else None,
        )

    def propose(self, state: EvolutionState) -> Proposal:
        """Return the offspring of a generation."""
        key, key_offspring = jax.random.split(state.key)
        offspring, origin, parents = self._offspring(key_offspring, state, self._seeding(state))
        born = jnp.full(self.config.offspring, state.generation + 1)
        bred = Proposal(key, offspring, origin, born, *(parents or (None, None)))
        proposal = self._with_elite(state, bred)
        return self._with_opponent(state, proposal)

    def _with_opponent(self, state: EvolutionState, proposal: Proposal) -> Proposal:
        """Let all meet the same opponent, where genomes have one.

        After the first generation, and then every `hold`, it is the best of the last one.
        """
        if self.variation.met is None:
            return proposal
        best = jax.tree.map(lambda leaf: leaf[0], state.genomes)
        changes = (state.generation >= 0) & (state.generation % self.hold == 0)
        met = self.variation.met(proposal.offspring, best, changes)
        return dataclasses.replace(proposal, offspring=met)

    def _with_elite(self, state: EvolutionState, proposal: Proposal) -> Proposal:
        """Put the best parents in the first places, to be evaluated once more."""
        count, now = self._again(state)
        if not count:
            return proposal
        children = self._seeding(state) | ~now

        def kept(leaf: jax.Array, old: jax.Array) -> jax.Array:
            first = jnp.where(children, leaf[:count], old[:count])
            return leaf.at[:count].set(first)

        own, mothers, fathers = _own(state), proposal.mothers, proposal.fathers
        return dataclasses.replace(
            proposal,
            offspring=jax.tree.map(kept, proposal.offspring, state.genomes),
            origin=kept(proposal.origin, state.origin),
            born=kept(proposal.born, state.born),
            mothers=None if mothers is None else kept(mothers, own),
            fathers=None if fathers is None else kept(fathers, jnp.full_like(own, NO_PARENT)),
        )

    def _again(self, state: EvolutionState) -> tuple[int, jax.Array]:
        """Return the number of best parents to evaluate again, and whether [] that happens now."""
        if self.config.elites or state.stale is None:
            return self.config.elites, jnp.ones((), bool)
        return min(self.config.population, self.config.offspring), state.stale

    def _stay(self, state: EvolutionState) -> jax.Array:
        """Return whether [] parents survive although otherwise only children do.

        A forced generation replaces only the worst of the population. Its parents keep the fitness
        of the generation before.
        """
        if not self.config.elites:
            return jnp.zeros((), bool)
        return state.forced if state.stale is None else state.forced & ~state.stale

    def promising(
        self, state: EvolutionState, proposal: Proposal, evaluation: Evaluation, share: float
    ) -> jax.Array:
        """Select the offspring [M] that deserve more trials than the first, evaluated alone so far.

        These are the best `share` of all, and the parents that are evaluated once more.
        """
        generation = jnp.maximum(state.generation + 1, 0)
        worth = self._fitness(proposal.offspring, evaluation.terms[:, :1], generation)
        place = jnp.argsort(jnp.argsort(-worth))
        best = (place < round(share * len(place))) & jnp.isfinite(worth)
        count, now = self._again(state)
        return best | ((jnp.arange(len(place)) < count) & now & ~self._seeding(state))

    def absorb(
        self, state: EvolutionState, proposal: Proposal, evaluation: Evaluation
    ) -> tuple[EvolutionState, GenerationMetrics]:
        """Select the survivors, and decide whether the next generation is forced."""
        seeding = self._seeding(state)
        recalled, rounds = self._recalled(state, evaluation)
        # The first generation takes as many calls as its candidates need, any later one a call.
        waits = seeding & ~self._filled(state) & (state.generation < 0)
        generation = jnp.where(waits, -1, state.generation + 1)
        pool = pooled(state, proposal, recalled, rounds)
        fitness = self._fitness(pool.genomes, pool.terms, generation)
        again, now = self._again(state)
        survival = Survival(self.config, self.variation, now if again else None, self._stay(state))
        grown, kept = survival.survivors(state, proposal, pool, fitness, evaluation.terms)
        planted = self._plant(state, proposal, evaluation, generation)
        state = choose(seeding, _without_key(planted), _without_key(grown))
        was_forced = state.forced
        state = dataclasses.replace(state, key=proposal.key, generation=generation)
        normal = self._learnt(state, proposal, evaluation, seeding)
        state = dataclasses.replace(state, normal=normal)
        state = with_forced_phase(self.config, state)
        state = with_restart(self.config.restart, state, complete=~self._seeding(state))
        mothers, fathers = self._logged(proposal, kept, seeding)
        return state, metrics(self.config, state, evaluation, was_forced, mothers, fathers)

    def _logged(
        self, proposal: Proposal, kept: jax.Array, seeding: jax.Array
    ) -> tuple[jax.Array | None, jax.Array | None]:
        """Return the parents' places [P] of the population, as metrics have them.

        kept: [P] places of the population among the old and the offspring.
        """
        if not self.config.lineage or proposal.mothers is None or proposal.fathers is None:
            return None, None
        own = jnp.arange(self.config.population)
        mothers = jnp.append(own, proposal.mothers)[kept]
        fathers = jnp.append(jnp.full_like(own, NO_PARENT), proposal.fathers)[kept]
        return jnp.where(seeding, NO_PARENT, mothers), jnp.where(seeding, NO_PARENT, fathers)

    @property
    def _strategy(self) -> SeparableCma:
        assert self.variation.box is not None, "refused before: see `make_spec`"
        return SeparableCma(self.variation.box, self.config.sigma)

    def _learnt(
        self,
        state: EvolutionState,
        proposal: Proposal,
        evaluation: Evaluation,
        seeding: jax.Array,
    ) -> Normal | None:
        """Return the distribution that a strategy has learnt after the generation of this state.

        It begins around the best of the first generation. It learns from children, not from the
        elite; where the old were evaluated instead of children it learns nothing.
        """
        if state.normal is None:
            return None
        children, terms, born = jax.tree.map(
            lambda leaf: leaf[self.config.elites :],
            (proposal.offspring, evaluation.terms, proposal.born),
        )
        now = jnp.maximum(state.generation, 0)
        # Of children that ran in the first trial alone, the better goes first.
        fitness, alone = (self._fitness(children, part, now) for part in (terms, terms[:, :1]))
        learnt = self._strategy.learnt(state.normal, children, fitness, alone)
        begun, fresh = self._strategy.begun(state.genomes), jnp.all(born == state.generation)

        def pick(first: jax.Array, new: jax.Array, old: jax.Array) -> jax.Array:
            return jnp.where(seeding, first, jnp.where(fresh, new, old))

        return jax.tree.map(pick, begun, learnt, state.normal)

    def _recalled(
        self, state: EvolutionState, evaluation: Evaluation
    ) -> tuple[Evaluation, jax.Array | None]:
        """Average the terms of parents evaluated once more over all their rounds.

        Also return the number of rounds [M].
        """
        if state.rounds is None:
            return evaluation, None
        count = self.config.elites
        rounds = jnp.ones(self.config.offspring).at[:count].add(state.rounds[:count])
        share = (1 / rounds[:count])[:, None, None]
        mean = share * evaluation.terms[:count] + (1 - share) * state.terms[:count]
        return dataclasses.replace(evaluation, terms=evaluation.terms.at[:count].set(mean)), rounds

    @property
    def _candidates(self) -> jax.Array:
        """Number [] of genomes evaluated for the first generation."""
        return jnp.asarray(self.config.initial_choice * self.config.population)

    def _fitness(self, genomes: object, terms: jax.Array, generation: jax.Array) -> jax.Array:
        worth, price = self.rank(terms, generation), self.variation.price
        return worth if price is None else worth - price(genomes)

    def _seeding(self, state: EvolutionState) -> jax.Array:
        return state.seeded < self._candidates

    def _filled(self, state: EvolutionState) -> jax.Array:
        return state.seeded + self.config.offspring >= self._candidates

    def _offspring(
        self, key: jax.Array, state: EvolutionState, seeding: jax.Array
    ) -> tuple[object, jax.Array, Parents | None]:
        """Return genomes [M, ...], their origins and their parents' places [M].

        The genomes are the unevaluated initial population, forced offspring, or children.
        """
        key_children, key_forced = jax.random.split(key)
        places = state.seeded + jnp.arange(self.config.offspring)
        keys_forced = jax.random.split(key_forced, 2 + self.config.forced.mutations)
        created = self.variation.create(keys_forced[0], self.config.offspring)
        known = jax.tree.map(lambda leaf: leaf[places % self.config.population], state.genomes)
        first = (state.generation < 0) & (places < self.config.population)
        initial = choose(first, known, created)
        bred, child_origin, parents = self._children(key_children, state)
        mutants, forced_origin, of_mutant = forced_offspring(
            keys_forced[1:], self.config, self.variation, state, created
        )

        def pick(first: Tree, second: Tree, third: Tree) -> Tree:
            return choose(seeding, first, choose(state.forced, second, third))

        genomes = pick(initial, mutants, bred)
        origin = pick(jnp.zeros_like(child_origin), forced_origin, child_origin)
        if not self.config.follows or parents is None:
            return genomes, origin, None
        (mothers, fathers), none = parents, jnp.full_like(origin, NO_PARENT)
        of_mutant = jnp.where(forced_origin == int(Origin.NEWCOMER), NO_PARENT, of_mutant)
        mothers = pick(jnp.full_like(origin, NO_PARENT), of_mutant, mothers)
        return genomes, origin, (mothers, pick(none, none, fathers))

    def _children(
        self, key: jax.Array, state: EvolutionState
    ) -> tuple[object, jax.Array, Parents | None]:
        """Return genomes drawn from the distribution, or bred, with their origins and parents."""
        if state.normal is None:
            return children(key, self.config, self.variation, state)
        count = self.config.offspring
        drawn = self._strategy.draw(key, state.normal, count)
        return self.variation.project(drawn), jnp.full(count, int(Origin.DRAWN)), None

    def _plant(
        self,
        state: EvolutionState,
        proposal: Proposal,
        evaluation: Evaluation,
        generation: jax.Array,
    ) -> EvolutionState:
        """Keep the best P of the evaluated candidates, then those not evaluated yet, in order."""
        count = self.config.population
        pool = together(
            (state.genomes, state.terms, state.outcome),
            (proposal.offspring, evaluation.terms, evaluation.outcome),
        )
        seeded = jnp.minimum(state.seeded + self.config.offspring, self._candidates)
        places, offspring = jnp.arange(count), jnp.arange(self.config.offspring)
        known = jnp.append(places < state.seeded, state.seeded + offspring < seeded)
        waiting = jnp.append(places >= seeded, jnp.zeros_like(offspring, bool))
        worth = self._fitness(pool[0], pool[1], jnp.maximum(generation, 0))
        fitness = jnp.where(known, worth, -jnp.inf)
        turn = jnp.where(known, 2, jnp.where(waiting, 1, 0))
        kept = jnp.lexsort((-fitness, -turn))[:count]
        genomes, terms, outcome = jax.tree.map(lambda leaf: leaf[kept], pool)
        return dataclasses.replace(
            state,
            genomes=genomes,
            terms=terms,
            outcome=outcome,
            fitness=fitness[kept],
            born=jnp.full(count, jnp.maximum(generation, 0)),
            origin=jnp.full(count, int(Origin.INITIAL), jnp.int32),
            seeded=seeded.astype(jnp.int32),
        )


def _own(state: EvolutionState) -> jax.Array:
    """Return each individual's own place [P]."""
    return jnp.arange(state.fitness.shape[0])


def _without_key(state: EvolutionState) -> EvolutionState:
    """Drop the key: `where` cannot choose between typed keys; the caller sets the next one."""
    return dataclasses.replace(state, key=jnp.zeros(()))
