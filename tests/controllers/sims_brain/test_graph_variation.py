"""Variation is closed: every child is a graph within its ranges and grows into a body."""

import dataclasses
from collections.abc import Callable
from functools import cache
from typing import Any, Literal

import jax
import numpy as np
import pytest
from controllers.sims_brain.made_up import genome_of, one

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.controller import Brains
from mjxgait.controllers.sims_brain.genotype import STEER, Capacity, NerveRoom, Ranges
from mjxgait.controllers.sims_brain.growth import grown
from mjxgait.controllers.sims_brain.operators import (
    Genotype,
    GraphOperators,
    Rates,
    reachable,
)
from mjxgait.controllers.sims_brain.reference_body import JOINTS, NEURONS
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import Origin
from mjxgait.inspect.family import CROSSED, GRAFTED, Relative, connected, mixed

CAPACITY, ROOM, RANGES, COUNT = Capacity(), NerveRoom(steer=True, skills=3), Ranges(), 2000
OPERATORS = GraphOperators(CAPACITY, ROOM, RANGES, Rates(value=20.0, connection=0.8, node=0.8))
BUSY = ("mutate", "cross", "graft")
ALIVE = jax.jit(jax.vmap(reachable))
GROWN = jax.jit(jax.vmap(lambda graph: grown(graph, CAPACITY)))


@pytest.fixture(scope="module")
def parents() -> tuple[Genotype, Genotype]:
    create = jax.jit(jax.vmap(OPERATORS.create))
    first, second = (create(jax.random.split(key_of(seed), COUNT)) for seed in (0, 1))
    return jax.device_get((first, second))


@cache
def breeder(name: str) -> Callable[..., Genotype]:
    """An operator, compiled once for all its children."""
    return jax.jit(jax.vmap(getattr(OPERATORS, name)))


@jax.jit
def _mutated(rates: tuple[Any, ...], keys: jax.Array, mothers: Genotype) -> Genotype:
    """Rates are traced, as in a run, so that all share a program."""
    return jax.vmap(GraphOperators(CAPACITY, ROOM, RANGES, Rates(*rates)).mutate)(keys, mothers)


def mutants(mothers: Genotype, seed: int, rates: Rates = OPERATORS.rates) -> Genotype:
    values = [getattr(rates, field.name) for field in dataclasses.fields(rates)]
    keys = jax.random.split(key_of(seed), COUNT)
    return jax.device_get(_mutated(tuple(values), keys, mothers))


def children(name: str, parents: tuple[Genotype, Genotype], seed: int = 2) -> Genotype:
    if name == "mutate":
        return mutants(parents[0], seed)
    return jax.device_get(breeder(name)(jax.random.split(key_of(seed), COUNT), *parents))


@pytest.fixture(scope="module", params=BUSY)
def bred(request: pytest.FixtureRequest, parents: tuple[Genotype, Genotype]) -> Genotype:
    """Children of three generations, so that small errors add up."""
    pair = parents
    for seed in range(3):
        pair = children(request.param, pair, seed), children(request.param, pair[::-1], seed + 10)
    return pair[0]


def test_children_are_graphs_within_their_ranges(bred: Genotype):
    graph, nerves, centre = bred.graph, bred.nerves, bred.centre
    bounds = [
        (graph.half, *RANGES.half),
        (graph.swing, *RANGES.swing),
        (graph.scale, *RANGES.scale),
        (graph.place, -1, 1),
        (graph.turn, -RANGES.turn, RANGES.turn),
        (graph.joint, 0, len(JOINTS) - 1),
        (graph.recursion, 0, RANGES.recursion),
        (graph.target, 0, CAPACITY.nodes - 1),
        (graph.mirror, 0, 2),
        *((part.kind, 0, len(NEURONS) - 1) for part in (nerves, centre)),
        *((part.source, 0, ROOM.codes - 1) for part in (nerves, centre)),
        (nerves.effect_source, 0, ROOM.codes - 1),
        (nerves.steer, *STEER),
    ]
    for values, low, high in bounds:
        assert np.isfinite(values).all()
        assert values.min() >= low - 1e-6
        assert values.max() <= high + 1e-6


def test_children_grow_into_different_bodies(bred: Genotype):
    parts = GROWN(bred.graph)
    count = np.asarray(parts.exists.sum(1))
    assert count.min() >= 1
    assert len(np.unique(count)) > 6


def test_the_same_key_gives_the_same_child(parents: tuple[Genotype, Genotype]):
    for name in BUSY:
        first, again = (children(name, parents) for _ in range(2))
        for a, b in zip(jax.tree.leaves(first), jax.tree.leaves(again), strict=True):
            np.testing.assert_array_equal(a, b)


def test_crossover_keeps_nodes_whole(parents: tuple[Genotype, Genotype]):
    mother, father = parents
    child = children("cross", parents)
    came = {}
    for name in ("graph", "nerves"):
        for field in dataclasses.fields(getattr(child, name)):
            mine, hers, his = (
                getattr(getattr(g, name), field.name).reshape(COUNT, CAPACITY.nodes, -1)
                for g in (child, mother, father)
            )
            came[name, field.name] = ((mine == hers).all(2), (mine == his).all(2))
    hers, his = (np.stack([found[k] for found in came.values()]).all(0) for k in (0, 1))
    assert (hers | his).all()
    assert 0.4 < hers.mean() < 0.9
    np.testing.assert_array_equal(child.centre.kind, mother.centre.kind)


def test_a_graft_attaches_the_fathers_root_to_the_mothers_graph(parents: tuple[Genotype, Genotype]):
    mother, father = parents
    child = children("graft", parents)
    before, after = np.asarray(ALIVE(mother.graph)), np.asarray(ALIVE(child.graph))
    room = ~before.all(1)
    half, his = child.graph.half, father.graph.half
    # The father's root takes the first free node, and is reached.
    first = np.argmax(~before, axis=1)
    rows = np.arange(COUNT)
    np.testing.assert_array_equal(half[rows, first][room], his[:, 0][room])
    assert after[rows, first][room].all()
    same = jax.tree.map(lambda a, b: bool((a[~room] == b[~room]).all()), child, mother)
    assert all(jax.tree.leaves(same)), "without room nothing is grafted"


def test_grafted_nodes_keep_their_connections(parents: tuple[Genotype, Genotype]):
    """The father's nodes keep their targets in new places; targets without a place are dropped."""
    mother, father = parents
    child = children("graft", parents)
    free = ~np.asarray(ALIVE(mother.graph))
    led, dropped = 0, 0
    for row in range(COUNT):
        # The father's first nodes take the free places in order.
        places = np.flatnonzero(free[row])
        mine, his = one(child.graph, row), one(father.graph, row)
        for node, place in enumerate(places):
            kept = his.used[node] & (his.target[node] < len(places))
            assert mine.used[place].tolist() == kept.tolist()
            assert mine.target[place][kept].tolist() == places[his.target[node][kept]].tolist()
            led, dropped = led + kept.sum(), dropped + (his.used[node] & ~kept).sum()
    assert led > COUNT
    assert dropped > COUNT / 10


def changed(child: Genotype, parent: Genotype) -> np.ndarray:
    """Number [COUNT] of changed values of connected nodes."""
    alive = np.asarray(ALIVE(parent.graph))
    changes = np.zeros(COUNT)
    for name in ("graph", "nerves"):
        leaves = zip(*(jax.tree.leaves(getattr(g, name)) for g in (child, parent)), strict=True)
        for mine, hers in leaves:
            differs = (mine != hers).reshape(COUNT, CAPACITY.nodes, -1).sum(2)
            changes += (differs * alive).sum(1)
    return changes


def test_a_mutation_changes_a_few_values(parents: tuple[Genotype, Genotype]):
    child = mutants(parents[0], 3, Rates(value=4.0, connection=0.0, node=0.0))
    changes = changed(child, parents[0])
    # A kind that is drawn again may come out the same.
    assert 2.5 < changes.mean() < 4.2
    np.testing.assert_array_equal(child.graph.used, parents[0].graph.used)


def test_with_random_strengths_most_mutations_are_mild_and_few_strong(
    parents: tuple[Genotype, Genotype],
):
    rates = Rates(value=8.0, connection=0.8, node=0.0, strength=(1 / 16, 2.0))
    child = mutants(parents[0], 3, rates)
    # Only children with unchanged connections: a connection takes values with it.
    same = (child.graph.used == parents[0].graph.used).all((1, 2))
    changes = changed(child, parents[0])[same]
    assert (changes <= 1).mean() > 0.3
    assert (changes >= 9).mean() > 0.03
    # The mean of min(strength, 1), log-uniform between them, is (1 - 1/16 + ln 2) / ln 32.
    assert 1 - same.mean() == pytest.approx(0.8 * 0.47, abs=0.05)


def test_a_resize_multiplies_all_sizes_by_one_factor(parents: tuple[Genotype, Genotype]):
    rates = Rates(value=0.0, connection=0.0, node=0.0, resize=0.25)
    child = mutants(parents[0], 3, rates)
    factor = child.graph.half / parents[0].graph.half
    resized = (factor != 1).any((1, 2))
    assert resized.mean() == pytest.approx(0.25, abs=0.04)
    low, high = RANGES.half
    within = (child.graph.half > low) & (child.graph.half < high)
    spread = [np.ptp(one[free]) for one, free in zip(factor, within, strict=True) if free.any()]
    assert max(spread) < 1e-5
    assert np.std(np.log(np.median(factor[resized], (1, 2)))) == pytest.approx(0.2, abs=0.03)
    same = jax.tree.map(
        np.array_equal,
        dataclasses.replace(
            child, graph=dataclasses.replace(child.graph, half=parents[0].graph.half)
        ),
        parents[0],
    )
    assert all(jax.tree.leaves(same))


@pytest.mark.thorough("a special case; test_a_mutation_changes_a_few_values has the usual numbers")
def test_central_neurons_do_not_change_a_graphs_mutation():
    """Central neurons do not grow, so they do not count among the values of which a few change."""
    graphs = []
    for central in (CAPACITY.nodes, CAPACITY.nodes + 1):
        operators = GraphOperators(CAPACITY, NerveRoom(central=central), RANGES)
        keys = jax.random.split(key_of(4), 100)
        child = jax.jit(
            jax.vmap(lambda key, operators=operators: operators.mutate(key, operators.create(key)))
        )(keys)
        graphs.append(child.graph)
    for a, b in zip(*map(jax.tree.leaves, graphs), strict=True):
        np.testing.assert_array_equal(a, b)


def test_mutation_adds_and_removes_nodes_and_connections(parents: tuple[Genotype, Genotype]):
    child = children("mutate", parents)
    used, before = (g.graph.used.sum((1, 2)) for g in (child, parents[0]))
    assert (used > before).mean() > 0.2
    assert (used < before).mean() > 0.05
    alive, were = (np.asarray(ALIVE(g.graph)).sum(1) for g in (child, parents[0]))
    assert (alive > were).mean() > 0.2
    assert (alive < were).mean() > 0.03


FREE = pytest.mark.thorough("other tests here have bodies that vary")
PARTS = {
    "all": {"graph", "nerves", "centre", "steer"},
    "brain": {"nerves", "centre", "steer"},
    "steering": {"steer"},
}


@pytest.mark.parametrize("evolves", ["brain", "steering", pytest.param("all", marks=FREE)])
def test_only_what_may_evolve_differs_from_the_mother(
    parents: tuple[Genotype, Genotype], evolves: Literal["all", "brain", "steering"]
):
    """Under any operator."""
    controller = Brains(0.01, BrainConfig(steer=True, skills=3))
    bred = controller.variation(
        BrainConfig(steer=True, skills=3, evolves=evolves), EvolutionConfig()
    )
    keys = jax.random.split(key_of(3), 200)
    few = [jax.tree.map(lambda leaf: leaf[:200], parent) for parent in parents]

    @jax.jit
    @jax.vmap
    def child(key: jax.Array, mother: Genotype, father: Genotype) -> Genotype:
        return bred.mutate(key, bred.cross(key, mother, father))

    young, old = _parts(child(keys, *few)), _parts(few[0])
    changed = {name: _differing(young[name], old[name]) for name in PARTS["all"]}
    assert {name for name, share in changed.items() if share > 0} == PARTS[evolves]
    assert all(changed[name] > 0.5 for name in PARTS[evolves]), changed


def _parts(genome: Genotype) -> dict[str, object]:
    steer = genome.nerves.steer
    nerves = dataclasses.replace(genome.nerves, steer=None)
    return {"graph": genome.graph, "nerves": nerves, "centre": genome.centre, "steer": steer}


def _differing(young: object, old: object) -> float:
    """Share of rows in which one of the leaves differs."""
    pairs = zip(*([np.asarray(x) for x in jax.tree.leaves(t)] for t in (young, old)), strict=True)
    return float(np.mean(np.any([(a != b).reshape(len(a), -1).any(1) for a, b in pairs], axis=0)))


def test_steering_cannot_evolve_without_its_weights():
    with pytest.raises(ValueError, match="needs steer"):
        BrainConfig(evolves="steering")


def relative(genotypes: Genotype, place: int) -> Relative:
    return Relative(0, place, Origin.CROSSOVER, 0.0, genome_of(one(genotypes.graph, place)))


@pytest.mark.parametrize(("name", "other"), [("cross", GRAFTED), ("graft", CROSSED)])
def test_a_family_tree_tells_how_a_father_came_in(
    parents: tuple[Genotype, Genotype], name: str, other: str
):
    """Read off the genomes, mutated afterwards as in a run: only then may a father be missed."""
    mother, father = parents
    pure = children(name, parents)
    changed = mutants(pure, 5, Rates(value=2.0, connection=0.0, node=0.0, resize=0.0))
    word = CROSSED if name == "cross" else GRAFTED
    seen = 0
    for place in range(60):
        hers, his, mine = (relative(one, place) for one in (mother, father, pure))
        nodes = connected(mine.body)
        same = [np.array_equal(mine.body[key][nodes], hers.body[key][nodes]) for key in mine.body]
        found = mixed(mine, hers, his)
        assert found != other
        assert (found == word) or all(same) or len(nodes) == len(connected(hers.body))
        assert mixed(relative(changed, place), hers, his) == found
        assert mixed(hers, hers, his) == "mutation"
        seen += found == word
    assert seen > 20
