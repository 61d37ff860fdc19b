"""The genetic algorithm on a toy problem without physics: find the centre of a box."""

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mjxgait.config.evolution import EvolutionConfig, ForcedConfig, RestartConfig
from mjxgait.config.schema import Config
from mjxgait.config.traced import traced
from mjxgait.controllers.key_poses.controller import Genome
from mjxgait.controllers.key_poses.operators import pose_variation
from mjxgait.evolution.breeding import parents, proportional_parents
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.evolution import Evolution
from mjxgait.evolution.state import (
    NO_PARENT,
    EvolutionState,
    GenerationMetrics,
    Origin,
    Proposal,
    stop_reason,
)
from mjxgait.evolution.survival import families, first_of_kind, place_in_family
from mjxgait.evolution.variation import Box, Variation, first_occurrence
from mjxgait.types import Evaluation, pytree

FORCED, NEVER = ForcedConfig(window=2), ForcedConfig(window=2, enabled=False)
"""The same window of two generations: its length shapes the program."""
K, J = 2, 3
BOX = Box(Genome(-jnp.ones((K, J)), jnp.zeros(1)), Genome(jnp.ones((K, J)), jnp.zeros(1)))


@pytree
class Problem:
    """Toy fitness with its maximum at the centre, or NaN where the first gene is out of limits.

    slope: weight of the distance. cost: price of each pose with a positive first gene. silent: only
    the first gene counts.
    """

    slope: float = 1.0
    cost: float = 0.0
    silent: bool = False
    lowest: float = -2.0
    highest: float = 2.0

    def value(self, genomes: Genome) -> jax.Array:
        first = genomes.key_poses[:, 0, 0]
        inside = (first >= self.lowest) & (first <= self.highest)
        worth = jnp.where(self.silent, -(first**2), near_zero(genomes))
        return jnp.where(inside, self.slope * worth, jnp.nan)

    def price(self, genomes: Genome) -> jax.Array:
        return self.cost * jnp.sum(genomes.key_poses[:, :, 0] > 0, axis=1)


CENTRE, FLAT, SILENT = Problem(), Problem(slope=0.0), Problem(silent=True)


def near_zero(genomes: Genome) -> jax.Array:
    return -jnp.sum(genomes.key_poses**2, axis=(1, 2))


@dataclasses.dataclass(frozen=True, eq=False)
class Toy(Evolution):
    """An evolution with its own evaluation."""

    problem: Problem

    def step(self, state: EvolutionState) -> tuple[EvolutionState, GenerationMetrics]:
        return self.step_and_births(state)[:2]

    def step_and_births(
        self, state: EvolutionState
    ) -> tuple[EvolutionState, GenerationMetrics, Genome]:
        """The next state, its metrics and the offspring."""
        proposal = self.propose(state)
        terms = self.problem.value(proposal.offspring)[:, None, None]
        evaluation = Evaluation(
            terms=terms,
            outcome=terms,
            failed=~jnp.isfinite(terms[..., 0]),
            sim_steps=jnp.int32(0),
            computed_steps=jnp.int32(0),
        )
        return *self.absorb(state, proposal, evaluation), proposal.offspring


def toy(problem: Problem = CENTRE, **settings) -> Toy:
    plain = EvolutionConfig(population=20, generations=30, forced=FORCED, lineage=True)
    return made(dataclasses.replace(plain, **settings), problem)


def made(config: EvolutionConfig, problem: Problem) -> Toy:
    """A toy from settings, plain or traced."""

    def rank(terms: jax.Array, generation: jax.Array) -> jax.Array:
        return jnp.where(jnp.isfinite(terms[..., 0, 0]), terms[..., 0, 0], -jnp.inf)

    variation = dataclasses.replace(pose_variation(BOX, config), price=problem.price)
    return Toy(config, variation, rank, problem)


def inputs(toy: Toy) -> tuple[EvolutionConfig, Problem]:
    """Inputs of the programs below; toys that differ only in numbers share them, as runs do."""
    return traced(Config(evolution=toy.config)).evolution, toy.problem


@jax.jit
def begin(settings: EvolutionConfig, problem: Problem, key: jax.Array) -> EvolutionState:
    return made(settings, problem).init(key, 1, 1, 1)


@jax.jit
def advance(
    settings: EvolutionConfig, problem: Problem, state: EvolutionState
) -> tuple[EvolutionState, GenerationMetrics, Genome]:
    return made(settings, problem).step_and_births(state)


def begun(evolution: Toy, seed: int = 0, has_curriculum: bool = False) -> EvolutionState:
    """The first state. has_curriculum: its task's trials may become harder later."""
    state: EvolutionState = begin(*inputs(evolution), key_of(seed))
    if not has_curriculum:
        return state
    return dataclasses.replace(state, level=jnp.int32(0), stale=jnp.zeros((), bool))


def run(
    evolution: Toy,
    generations: int = 30,
    seed: int = 0,
    program: Callable[..., Any] = advance,
    has_curriculum: bool = False,
) -> list[tuple[EvolutionState, GenerationMetrics]]:
    given = inputs(evolution)
    state, history = begun(evolution, seed, has_curriculum), []
    while len(history) < generations:
        state, metrics, _ = jax.device_get(program(*given, state))
        if state.generation >= 0:
            history.append((state, metrics))
    return history


def test_the_best_never_falls_and_the_algorithm_finds_the_optimum():
    best = [float(metrics.best) for _, metrics in run(toy(), 60)]
    assert all(later >= earlier for earlier, later in itertools.pairwise(best))
    assert best[-1] > -0.1 > best[0]


@pytest.mark.parametrize("seed", range(5))
def test_the_best_survives_forced_evolution_too(seed: int):
    forced = ForcedConfig(window=2, gain=10.0, refresh=1.0, patience=0)
    best = [float(metrics.best) for _, metrics in run(toy(forced=forced), 30, seed)]
    assert all(later >= earlier for earlier, later in itertools.pairwise(best))


def test_the_best_of_old_and_new_survive():
    state = run(toy(), 3)[-1][0]
    after, _, born = advance(*inputs(toy()), state)
    best = np.unique(np.concatenate([state.fitness, near_zero(born)]))[::-1][:20]
    assert np.allclose(after.fitness, best)
    assert not np.allclose(state.fitness, best)


def test_only_the_best_parent_survives_when_children_replace_parents():
    replacing = toy(survival="children", remove_duplicates=False, crossover=0.9, forced=NEVER)
    history = run(replacing, 12)
    for (before, _), (after, _) in itertools.pairwise(history):
        assert after.fitness[0] >= before.fitness[0]
        assert np.sum(after.born < after.generation) <= 1
    assert any(
        np.mean(after.fitness) < np.mean(before.fitness)
        for (before, _), (after, _) in itertools.pairwise(history)
    )


def test_the_elite_is_evaluated_again():
    """Only the elite survives, with the fitness of its latest evaluation."""
    keeping = toy(survival="children", elite=0.15, forced=NEVER)
    (before, _), settings = run(keeping, 4)[-1], inputs(keeping)[0]
    after, _, births = jax.device_get(advance(settings, Problem(slope=2.0), before))
    poses = births.key_poses
    np.testing.assert_array_equal(poses[:3], before.genomes.key_poses[:3])
    assert not any((poses[3:] == old).all((1, 2)).any() for old in before.genomes.key_poses[:3])
    np.testing.assert_allclose(after.fitness, 2 * near_zero(after.genomes), rtol=1e-6)
    lived = {tuple(pose.ravel()) for pose in after.genomes.key_poses[after.born < after.generation]}
    assert lived == {tuple(pose.ravel()) for pose in before.genomes.key_poses[:3]}
    assert set(after.born[after.born < after.generation]) <= set(before.born)


REMEMBERING = {
    "growth": 6.0,
    "survival": "children",
    "elite": 0.15,
    "remember": True,
    "forced": NEVER,
    "same": "verdict",
}


def test_remembered_elite_fitness_is_the_mean_of_its_rounds():
    """Children have one round; all rounds have the same weight."""
    keeping = toy(**REMEMBERING)
    settings, before = inputs(keeping)[0], run(keeping, 4)[-1][0]
    for slope in (2.0, 6.0):
        known = dict(zip(map(bytes, before.genomes.key_poses[:3]), range(3), strict=True))
        after, _, _ = jax.device_get(advance(settings, Problem(slope=slope), before))
        for place, poses in enumerate(map(bytes, after.genomes.key_poses)):
            fresh, rounds = slope * float(near_zero(after.genomes)[place]), 1.0
            wanted = fresh
            if poses in known:
                earlier = before.rounds[known[poses]]
                rounds = earlier + 1
                wanted = (earlier * before.fitness[known[poses]] + fresh) / rounds
            assert after.rounds[place] == rounds
            assert after.fitness[place] == pytest.approx(wanted, rel=1e-5)
        before = after
    assert before.rounds.max() > 1


@pytest.mark.parametrize("stale", [True, False])
def test_all_parents_are_evaluated_again_after_trials_become_harder(stale: bool):
    """Then no old result survives; otherwise no individual is evaluated twice."""
    climbing = toy(forced=NEVER, growth=3.0)
    (before, _), settings = run(climbing, 4, has_curriculum=True)[-1], inputs(climbing)[0]
    before = dataclasses.replace(before, level=jnp.int32(1), stale=jnp.asarray(stale))
    after, _, births = jax.device_get(advance(settings, Problem(slope=2.0), before))
    again = (births.key_poses[:20] == before.genomes.key_poses).all((1, 2))
    old = after.born < after.generation
    assert again.all() if stale else not again.any()
    assert old.any()
    assert not old.all()
    worth = np.where(old & ~np.asarray(stale), 1, 2) * near_zero(after.genomes)
    np.testing.assert_allclose(after.fitness, worth, rtol=1e-6)
    assert len(np.unique(after.genomes.key_poses, axis=0)) == 20


SPARING = {"growth": 3.0, "forced": NEVER, "family": 0.25, "rivals": 4}


def test_no_lineage_exceeds_its_share():
    """A lineage follows the mothers to the first generation. The best fitness still never falls."""
    history = run(toy(**SPARING), 25)
    plain = run(toy(growth=3.0, forced=NEVER), 25, has_curriculum=True)
    for (before, _), (after, told) in itertools.pairwise(history):
        mothers = np.asarray(told.mothers)
        assert (after.family == before.family[mothers]).all()
        assert np.bincount(after.family).max() <= 5
        assert after.fitness[0] >= before.fitness[0]
    ancestors = np.arange(20)
    for _, told in plain[1:]:
        ancestors = ancestors[np.asarray(told.mothers)]
    assert len(np.unique(ancestors)) < len(np.unique(history[-1][0].family)) >= 4


@pytest.mark.parametrize("elite", [0.0, 0.25])
def test_no_lineage_exceeds_its_share_when_parents_die(elite: float):
    """If other lineages have too few children, their parents stay."""
    sparing = toy(
        **SPARING, survival="children", elite=elite, selection="tournament", mutation_rate=0.3
    )
    for state, _ in run(sparing, 25):
        assert np.bincount(state.family).max() <= 5
        assert len(np.unique(state.genomes.key_poses, axis=0)) == 20


def test_place_in_lineage_follows_rank():
    family = jnp.array([7, 7, 3, 7, 3, 7])
    rank = jnp.array([5, 1, 3, 2, 4, 0])
    counts = jnp.array([True, True, True, True, True, False])
    assert place_in_family(family, rank, counts).tolist() == [2, 0, 0, 1, 1, 0]


def test_each_immigrant_starts_a_lineage():
    state = dataclasses.replace(begun(toy(**SPARING)), family=jnp.arange(20) // 2)
    mothers = jnp.array([4, NO_PARENT, 5, NO_PARENT])
    old, new = np.split(np.asarray(families(state, mothers)), [20])
    assert (old == np.arange(20) // 2).all()
    assert new[[0, 2]].tolist() == [2, 2]
    assert len({*new[[1, 3]], *old}) == 12
    assert families(dataclasses.replace(state, family=None), mothers) is None


def test_genome_cost_is_subtracted_from_fitness():
    """A positive first gene costs 3, the most that a pose can lose by its squares; none remains."""
    dear = toy(Problem(cost=3.0), crossover=0.5)
    for state, _ in run(dear, 12):
        expected = near_zero(state.genomes) - dear.problem.price(state.genomes)
        np.testing.assert_allclose(state.fitness, expected, rtol=1e-5)
    assert not np.asarray(dear.problem.price(state.genomes)).any()


def test_earlier_results_do_not_count():
    """Parents fill the places without children; they have no new evaluation, so no fitness."""
    keeping = toy(survival="children", elite=0.15, forced=NEVER, growth=1.5)
    (before, _), settings = run(keeping, 4)[-1], inputs(keeping)[0]
    at_level = jax.device_get(advance(settings, Problem(slope=2.0), before))[0]
    evaluation = np.isfinite(at_level.fitness)
    assert evaluation.tolist() == [True] * 10 + [False] * 10
    expected = 2 * near_zero(at_level.genomes)[:10]
    np.testing.assert_allclose(at_level.fitness[:10], expected, rtol=1e-6)


def test_the_population_is_sorted_and_without_duplicates():
    for state, metrics in run(toy(mutation_rate=0.2, crossover=1.0)):
        assert np.all(np.diff(state.fitness) <= 0)
        assert np.allclose(near_zero(state.genomes), state.fitness)
        assert int(metrics.unique) == 20


def test_only_one_individual_per_result_survives_if_same_is_verdict():
    """Genomes that differ only in silent genes behave as copies."""
    crowd = {"growth": 3.0, "forced": NEVER}
    plain, _ = run(toy(SILENT, **crowd), 12, has_curriculum=True)[-1]
    state, told = run(toy(SILENT, **crowd, same="verdict"), 12, has_curriculum=True)[-1]
    assert int(told.unique) == 20
    assert len(np.unique(plain.fitness)) < 10
    assert len(np.unique(state.fitness)) == 20


def test_the_youngest_of_equal_results_survives():
    """Silent genes therefore drift, and may become useful later."""
    drifting = toy(SILENT, forced=NEVER, growth=3.0, same="verdict")
    before = run(drifting, 4, has_curriculum=True)[-1][0]
    after, _, births = jax.device_get(advance(*inputs(drifting), before))
    born = SILENT.value(births)
    known = np.isin(after.fitness, before.fitness) & np.isin(after.fitness, born)
    assert known.any()
    assert (after.born[known] == after.generation).all()


def test_results_are_compared_within_one_round():
    """An elite has the mean of its rounds and its copies have not; still only one survives."""
    keeping = toy(SILENT, **REMEMBERING)
    before, settings = run(keeping, 4)[-1][0], inputs(keeping)[0]
    after, _, _ = jax.device_get(advance(settings, Problem(slope=6.0, silent=True), before))
    firsts = np.abs(after.genomes.key_poses[:, 0, 0])
    assert (after.born < after.generation).any()
    assert len(np.unique(firsts)) == 20


@pytest.mark.parametrize("stale", [True, False])
def test_no_old_result_survives_harder_trials_if_same_is_verdict(stale: bool):
    """Trials have become harder, and too few results differ to fill the population."""
    climbing = toy(SILENT, forced=NEVER, growth=3.0, same="verdict")
    (before, _), settings = run(climbing, 4, has_curriculum=True)[-1], inputs(climbing)[0]
    before = dataclasses.replace(before, level=jnp.int32(1), stale=jnp.asarray(stale))
    after, _, _ = jax.device_get(advance(settings, Problem(slope=2.0, silent=True), before))
    old = after.born < after.generation
    assert old.any()
    terms = np.where(old & ~np.asarray(stale), 1, 2) * SILENT.value(after.genomes)
    np.testing.assert_allclose(after.terms[:, 0, 0], terms, rtol=1e-6)


def test_first_of_kind_compares_result_and_cost():
    """Two parents and two children with equal results: a costlier child is another kind, and a
    child without a result is never first.
    """
    poses, number = jnp.zeros((2, K, J)), jnp.zeros(2, jnp.int32)
    state = dataclasses.replace(
        begun(toy()), genomes=Genome(poses, jnp.zeros((2, 1))), terms=jnp.zeros((2, 1, 1))
    )
    proposal = Proposal(state.key, Genome(poses, jnp.ones((2, 1))), number, number)
    plain = dataclasses.replace(toy().variation, price=None)
    dear = dataclasses.replace(plain, price=lambda genomes: genomes.tuning[:, 0])

    def first(variation: Variation, verdict: float) -> list[bool]:
        @jax.jit
        def found(verdicts: jax.Array) -> jax.Array:
            anew = jnp.zeros((), bool)
            return first_of_kind("verdict", variation, state, proposal, verdicts, anew)

        return found(jnp.full((2, 1, 1), verdict)).tolist()

    assert first(plain, 0.0) == [False, False, True, False]
    assert first(dear, 0.0) == [True, False, True, False]
    assert first(plain, jnp.nan) == [True, False, False, False]


def test_duplicates_fill_the_population_when_they_may_stay():
    last = run(toy(remove_duplicates=False, crossover=0.0, mutation_rate=0.0), 20)[-1][1]
    assert int(last.unique) < 20


@pytest.mark.parametrize("growth", [1.2, 2.0, 3.0])
def test_the_initial_population_is_evaluated_before_generation_zero(growth: float):
    evolution = toy(growth=growth)
    created = begun(evolution)
    first = run(evolution, 1, has_curriculum=growth == 3.0)[0][0]
    assert int(first.generation) == 0
    assert np.allclose(first.fitness, np.sort(near_zero(created.genomes))[::-1])
    assert (first.origin == Origin.INITIAL).all()


@pytest.mark.parametrize("growth", [1.2, 2.0, 3.0])
def test_the_first_generation_is_the_best_of_the_requested_candidates(growth: float):
    plain, choosy = toy(growth=growth), toy(growth=growth, initial_choice=4)
    has_curriculum = growth == 3.0
    rounds, first = [], begun(choosy, has_curriculum=has_curriculum)
    while int(first.generation) < 0:
        first, _, evaluation = advance(*inputs(choosy), first)
        rounds.append(near_zero(evaluation))
    candidates = np.sort(np.concatenate(rounds)[:80])[::-1]
    assert len(set(candidates.tolist())) == 80
    np.testing.assert_allclose(first.fitness, candidates[:20], rtol=1e-6)
    np.testing.assert_allclose(near_zero(first.genomes), first.fitness, rtol=1e-6)
    assert np.median(first.fitness) > np.median(
        run(plain, 1, has_curriculum=has_curriculum)[0][0].fitness
    )


@pytest.mark.parametrize("growth", [1.2, 2.0, 3.0])
def test_a_population_that_has_learnt_nothing_is_drawn_anew(growth: float):
    calls = {1.2: 10, 2.0: 2, 3.0: 1}[growth]
    again = RestartConfig(every=4)
    evolution = toy(
        FLAT, growth=growth, initial_choice=2, restart=again, survival="children", forced=NEVER
    )
    states = [state for state, _ in run(evolution, 6 + calls)]
    before, after = states[4], states[4 + calls]
    assert [int(state.generation) for state in states] == list(range(6 + calls))
    assert (np.asarray(before.origin) != Origin.INITIAL).any()
    assert np.asarray(after.origin == Origin.INITIAL).all()
    assert (np.asarray(after.born) > 4).all()
    old, new = (np.asarray(state.genomes.key_poses) for state in (before, after))
    assert not (old[:, None] == new[None]).all((2, 3)).any()
    assert (np.asarray(states[5 + calls].origin) != Origin.INITIAL).any(), "then it evolves"


@pytest.mark.parametrize(("every", "below"), [(0, 0.0), (3, -1.0)])
def test_a_population_that_has_learnt_something_goes_on(every: int, below: float):
    plain, watched = (
        run(toy(FLAT, restart=restart), 8)[-1][0]
        for restart in (RestartConfig(), RestartConfig(every, below))
    )
    ends = (dataclasses.replace(end, key=jax.random.key_data(end.key)) for end in (plain, watched))
    jax.tree.map(np.testing.assert_array_equal, *ends)


def test_a_nonfinite_individual_loses_and_affects_no_other():
    for state, metrics in run(toy(Problem(highest=0.3)), 10)[1:]:
        assert np.isfinite(state.fitness).all()
        assert np.isfinite(metrics.mean)
        assert (state.genomes.key_poses[:, 0, 0] <= 0.3).all()


def test_a_population_without_one_good_individual_recovers():
    history = run(toy(Problem(lowest=0.99), mutation="pose"), 80)
    assert not np.isfinite(history[0][1].best)
    assert np.isfinite(history[-1][1].best)


def test_stagnation_starts_a_forced_phase_that_refreshes_and_ends():
    forced = ForcedConfig(window=2, newcomers=0.25, refresh=0.5, limit=2, patience=0)
    history = run(toy(FLAT, forced=forced), 16)
    flags = [bool(metrics.forced) for _, metrics in history]
    assert flags[:3] == [False] * 3
    assert flags[3]
    assert not all(flags[3:6])
    before, after = history[2][0], history[3][0]
    assert int(after.refreshed) == 10
    newborn = after.born == 3
    assert int(newborn.sum()) == 10
    assert set(np.asarray(after.origin)[newborn].tolist()) == {Origin.NEWCOMER, Origin.MUTATION}
    assert float(after.fitness[0]) >= float(before.fitness[0])


def lengths_of_spells(history: list[tuple[EvolutionState, GenerationMetrics]]) -> list[int]:
    flags = [bool(metrics.forced) for _, metrics in history]
    return [len(list(spell)) for forced, spell in itertools.groupby(flags) if forced]


@pytest.mark.parametrize(("limit", "length"), [(3, 3), (0, 5)])
def test_a_forced_phase_lasts_until_its_limit_or_until_refreshed(limit: int, length: int):
    """Each generation takes in four; 19 of 20 must be replaced."""
    forced = ForcedConfig(window=2, refresh=1.0, limit=limit, patience=0)
    assert lengths_of_spells(run(toy(FLAT, growth=1.2, forced=forced), 12))[0] == length


def test_a_forced_phase_without_limit_or_fit_children_does_not_end():
    """All begin near the optimum, and three redrawn poses are far from it."""
    forced = ForcedConfig(window=2, gain=1.0, newcomers=0.0, accept=1.0, limit=0, patience=0)
    near = toy(
        forced=forced, initial_spread=0.01, mutation="pose", mutation_rate=0.0, crossover=1.0
    )
    spells = lengths_of_spells(run(near, 20))
    assert len(spells) == 1
    assert spells[0] > 12


def test_the_log_names_each_individuals_mother():
    """Mutants of one joint resemble their mother more than any other individual."""
    following = toy(crossover=0.0, mutation="single", forced=NEVER)
    history, children = run(following, 12), 0
    assert (history[0][1].mothers == NO_PARENT).all()
    for (before, _), (after, metrics) in itertools.pairwise(history):
        mothers = before.genomes.key_poses[metrics.mothers]
        changed = (after.genomes.key_poses != mothers).sum(axis=(1, 2))
        born = after.born == after.generation
        assert (changed[born] <= 1).all()
        assert (changed[~born] == 0).all()
        children += born.sum()
    assert children > 20
    assert history[0][1].mothers.shape == (20,)


def test_the_log_names_the_father_of_each_child_of_two():
    """Without mutation each gene of such a child is one of its two parents'."""
    history = run(toy(crossover=1.0, mutation_rate=0.0, forced=NEVER), 8)
    children = of_father = 0
    assert (history[0][1].fathers == NO_PARENT).all()
    for (before, _), (after, metrics) in itertools.pairwise(history):
        born = after.born == after.generation
        assert (metrics.fathers[~born] == NO_PARENT).all()
        assert (metrics.fathers[born] != metrics.mothers[born]).all()
        mine = after.genomes.key_poses[born]
        hers, his = (
            mine == before.genomes.key_poses[places[born]]
            for places in (metrics.mothers, metrics.fathers)
        )
        assert (hers | his).all()
        children, of_father = children + born.sum(), of_father + (his & ~hers).any((1, 2)).sum()
    assert children > 20
    assert of_father > children / 2


def test_a_child_of_one_parent_has_no_father():
    for _, metrics in run(toy(crossover=0.0, forced=NEVER), 4):
        assert (metrics.fathers == NO_PARENT).all()


def test_a_growing_pool_evolves_and_simulates_no_genome_twice():
    settings = {"selection": "uniform", "crossing": "permute", "crossover": 1.0}
    evolution = toy(
        mutation_rate=0.0, pool="growing", unique_children=True, lineage=False, **settings
    )
    history = run(evolution, 10)
    assert float(history[-1][1].best) > float(history[0][1].best)
    state = history[-1][0]
    born = advance(*inputs(evolution), state)[2]
    everybody = jax.tree.map(lambda a, b: jnp.concatenate([a, b]), state.genomes, born)
    assert first_occurrence(everybody).all()


def test_no_forced_evolution_while_fitness_grows():
    forced = ForcedConfig(window=2, gain=0.0, patience=0)
    assert not any(bool(metrics.forced) for _, metrics in run(toy(forced=forced), 12))


def test_unfit_immigrants_are_rejected():
    forced = ForcedConfig(window=2, gain=10.0, newcomers=1.0, accept=1.0, patience=0)
    for (before, _), (after, metrics) in zip(
        history := run(toy(forced=forced), 12), history[1:], strict=False
    ):
        if metrics.forced:
            taken = np.asarray(after.born == after.generation)
            assert (np.asarray(after.fitness)[taken] >= float(before.fitness[0])).all()


def test_a_forced_generation_keeps_parents_that_would_otherwise_die():
    forced = ForcedConfig(window=2, gain=10.0, refresh=0.5, limit=1, patience=0)
    history = run(toy(survival="children", elite=0.15, forced=forced), 12)
    old = {
        bool(metrics.forced): int((state.born < state.generation).sum())
        for state, metrics in history[1:]
    }
    assert old[False] <= 3
    assert old[True] >= 10
    for (before, _), (after, metrics) in itertools.pairwise(history):
        if metrics.forced:
            assert np.isin(np.sort(before.fitness)[10:], after.fitness).all()


def test_a_run_stops_when_forced_evolution_no_longer_pays():
    forced = ForcedConfig(window=2, limit=1, patience=2)
    evolution = toy(FLAT, forced=forced)
    reasons = [stop_reason(state, evolution.config) for state, _ in run(evolution, 25)]
    assert next(reason for reason in reasons if reason).startswith(
        "forced evolution no longer pays"
    )


def test_a_run_stops_at_the_target_and_at_the_cap():
    state = run(toy(), 1)[0][0]
    assert "target" in stop_reason(state, EvolutionConfig(target=-100.0))
    assert "all 0 generations" in stop_reason(state, EvolutionConfig(generations=0))
    assert stop_reason(state, EvolutionConfig(target=100.0)) is None


@pytest.mark.parametrize("selection", ["uniform", "rank", "tournament"])
def test_the_two_parents_differ_and_better_ones_are_drawn_more_often(selection: str):
    mothers, fathers = parents(key_of(0), 20_000, 10, selection)
    assert (mothers != fathers).all()
    counts = np.bincount(np.asarray(mothers), minlength=10) / 20_000
    expected = np.full(10, 0.1) if selection == "uniform" else (19 - 2 * np.arange(10)) / 100
    assert np.allclose(counts, expected, atol=0.01)


def test_parents_may_be_drawn_in_proportion_to_their_fitness():
    fitness = jnp.array([6.0, 3.0, 1.0, 0.0, -4.0, -jnp.inf])
    mothers, fathers = proportional_parents(key_of(0), 20_000, fitness)
    assert (mothers != fathers).all()
    counts = np.bincount(np.asarray(mothers), minlength=6) / 20_000
    assert counts == pytest.approx([0.6, 0.3, 0.1, 0, 0, 0], abs=0.01)
    nobody, _ = proportional_parents(key_of(0), 6_000, jnp.full(6, -1.0))
    assert np.bincount(np.asarray(nobody), minlength=6) / 6_000 == pytest.approx(1 / 6, abs=0.03)


@pytest.mark.parametrize("rivals", [1, 6])
def test_larger_tournaments_select_better_parents(rivals: int):
    mothers, _ = parents(key_of(0), 20_000, 10, "tournament", rivals)
    # The winner has rank k or worse only if all rivals do.
    worse = (1 - np.arange(11) / 10) ** rivals
    assert np.bincount(mothers, minlength=10) / 20_000 == pytest.approx(-np.diff(worse), abs=0.015)


def test_one_generation_is_traced_once():
    traces = []

    def counted(*given: Any) -> Any:
        traces.append(1)
        return advance.__wrapped__(*given)

    counted.__name__ = "advance"  # the name that the compilation cache knows
    run(toy(), 10, program=jax.jit(counted))
    assert len(traces) == 1


def test_generations_draw_different_random_numbers():
    given, states = inputs(toy()), [state for state, _ in run(toy(), 6)]
    keys = {tuple(np.asarray(jax.random.key_data(state.key)).tolist()) for state in states}
    assert len(keys) == 6
    later = dataclasses.replace(states[0], key=states[1].key)
    one, other = (advance(*given, state)[2].key_poses for state in (states[0], later))
    assert not np.array_equal(one, other)


def test_the_same_seed_gives_the_same_run_and_another_seed_another():
    one, same, other = (run(toy(), 5, seed)[-1][0].genomes.key_poses for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
