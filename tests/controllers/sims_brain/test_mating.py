"""What a child of two takes from its father: `controller.graft` and `controller.centre`."""

import dataclasses
import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import jax
import numpy as np
import pytest
from controllers.sims_brain.made_up import genome_of, one

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.tables import build, dump_toml, parse_toml
from mjxgait.config.traced import traced_structure
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.controllers.sims_brain.controller import Brains
from mjxgait.controllers.sims_brain.genotype import Capacity, Graph, NerveRoom, Ranges
from mjxgait.controllers.sims_brain.operators import (
    Genotype,
    GraphOperators,
    Mating,
    reachable,
)
from mjxgait.evolution.chance import key_of
from mjxgait.evolution.state import Origin
from mjxgait.inspect.family import CROSSED, GRAFTED, Relative, mixed
from mjxgait.plugins import resolve_config

COUNT, CAPACITY = 200, Capacity()
PAPER = Mating(graft="any", centre="either")
ALIVE = jax.jit(jax.vmap(reachable))
Parents = tuple[Genotype, Genotype]


@cache
def bred(name: str, mating: Mating = PAPER) -> Callable[..., Genotype]:
    """An operator of `GraphOperators`, compiled for all its children."""
    operators = GraphOperators(CAPACITY, NerveRoom(), Ranges(), mating=mating)
    return jax.jit(jax.vmap(getattr(operators, name)))


def keys(seed: int) -> jax.Array:
    return jax.random.split(key_of(seed), COUNT)


@pytest.fixture(scope="module")
def parents() -> Parents:
    first, second = (bred("create")(keys(seed)) for seed in (0, 1))
    return jax.device_get((first, second))


def children(name: str, parents: Parents, mating: Mating = PAPER) -> Genotype:
    return jax.device_get(bred(name, mating)(keys(2), *parents))


def digest(genotypes: Genotype) -> str:
    """Of all whole numbers and flags: they do not depend on a processor's rounding."""
    leaves = [leaf for leaf in jax.tree.leaves(genotypes) if leaf.dtype.kind != "f"]
    return hashlib.sha256(b"".join(np.int32(leaf).tobytes() for leaf in leaves)).hexdigest()[:16]


def test_usual_offspring_are_as_before_these_settings(parents: Parents):
    found = [digest(children(name, parents, Mating())) for name in ("cross", "graft")]
    assert [digest(parents[0]), *found] == [
        "ac382a9c53dc1e73",
        "c0796701179e8e42",
        "b0048f1516c507e1",
    ]


def reached(graph: Graph, first: int) -> set[int]:
    """The nodes that a node leads to, and itself."""
    found, waiting = {first}, [first]
    for node in waiting:
        new = {int(other) for other in graph.target[node][graph.used[node]]} - found
        found |= new
        waiting += sorted(new)
    return found


def test_a_graft_may_attach_any_node_of_the_fathers_body(parents: Parents):
    """With all that this one reaches, which has the first of the room; its connections lead on."""
    mother, father = parents
    child = children("graft", parents)
    free, after = ~np.asarray(ALIVE(mother.graph)), np.asarray(ALIVE(child.graph))
    attached, cut, whole = [], 0, 0
    for row in np.flatnonzero(free.any(1)):
        places = np.flatnonzero(free[row]).tolist()
        mine, his = one(child.graph, row), one(father.graph, row)
        came = [int(np.flatnonzero((his.half == mine.half[p]).all(1))[0]) for p in places]
        root, needed = came[0], reached(his, came[0])
        assert root in reached(his, 0), "of the body"
        assert after[row, places[0]]
        assert set(came[: len(needed)]) <= needed
        for place, node in zip(places, came, strict=True):
            kept = his.used[node] & np.isin(his.target[node], came)
            assert mine.used[place].tolist() == kept.tolist()
            led = [places[came.index(int(t))] for t in his.target[node][kept]]
            assert mine.target[place][kept].tolist() == led
        attached.append(root)
        cut += len(places) < len(needed)
        whole += len(needed) > 1
    assert 0.2 < np.mean(np.array(attached) > 0) < 0.9
    assert len(set(attached)) >= 4
    assert cut > 0
    assert whole > COUNT / 4


def test_without_room_nothing_is_grafted(parents: Parents):
    """The child is the mother, with her central neurons."""
    mother, last = parents[0], CAPACITY.nodes - 1
    chain = np.tile(np.minimum(np.arange(last + 1) + 1, last)[:, None], (COUNT, 1, 3))
    graph = dataclasses.replace(mother.graph, target=chain, used=np.ones_like(mother.graph.used))
    crowded = dataclasses.replace(mother, graph=graph)
    child = children("graft", (crowded, parents[1]))
    assert all(jax.tree.leaves(jax.tree.map(np.array_equal, child, crowded)))


@pytest.mark.parametrize("name", ["cross", "graft"])
def test_central_neurons_come_from_either_parent_as_a_whole(parents: Parents, name: str):
    mother, father = parents
    room = ~np.asarray(ALIVE(mother.graph)).all(1)
    child = children(name, parents)
    hers, his = (
        np.all([(a == b).reshape(COUNT, -1).all(1) for a, b in pairs], axis=0)
        for pairs in (
            list(zip(*map(jax.tree.leaves, (child.centre, other.centre)), strict=True))
            for other in (mother, father)
        )
    )
    assert (hers ^ his).all()
    assert hers[~room].all() or name == "cross"
    assert 0.4 < his[room].mean() < 0.6


def test_the_settings_reach_the_operators(parents: Parents):
    """A run's offspring, all of them crossed or all grafted."""
    mother, father = parents
    for crossover, grafting in ((1.0, 0.0), (0.0, 1.0)):
        settings = BrainConfig(crossover=crossover, grafting=grafting, graft="any", centre="either")
        cross = Brains(0.01, settings).variation(settings, EvolutionConfig()).cross
        child = jax.device_get(jax.jit(jax.vmap(cross))(keys(3), mother, father))
        name, own = ("cross" if crossover else "graft"), jax.vmap(lambda k: jax.random.split(k)[1])
        wanted = jax.device_get(bred(name)(own(keys(3)), mother, father))
        assert all(jax.tree.leaves(jax.tree.map(np.array_equal, child, wanted)))


@pytest.mark.parametrize(
    "given", [{"graft": "any"}, {"centre": "either"}, {"children": 3}], ids=lambda given: str(given)
)
def test_another_choice_is_another_program(given: dict[str, str | int]):
    """Runs side by side share one only if they agree; a file without the keys is an older run's."""
    config = resolve_config({"use": {"controller": "brain", "task": "swim"}}, "blocks")
    other = dataclasses.replace(config, controller=BrainConfig(**given))
    assert traced_structure(config) != traced_structure(other)
    stored = parse_toml(dump_toml(other.controller), "test")
    assert build(BrainConfig, stored, "test") == other.controller
    older = {name: value for name, value in stored.items() if name not in given}
    assert build(BrainConfig, older, "test") == BrainConfig()


def test_the_papers_configuration_has_its_mating():
    settings = resolve_config({}, "blocks", Path("sims")).controller
    assert isinstance(settings, BrainConfig)
    assert (settings.graft, settings.centre, settings.children) == ("any", "either", 3)


def relative(genotypes: Genotype, place: int) -> Relative:
    return Relative(0, place, Origin.CROSSOVER, 0.0, genome_of(one(genotypes.graph, place)))


@pytest.mark.parametrize(("name", "word"), [("cross", CROSSED), ("graft", GRAFTED)])
def test_a_family_tree_tells_a_graft_of_any_node_from_a_crossover(
    parents: Parents, name: str, word: str
):
    """Also where a node of the father's happens to take the place that it had."""
    mother, father = parents
    child = children(name, parents)
    reaches, own, seen = np.asarray(ALIVE(child.graph)), 0, 0
    for place in range(COUNT):
        mine, hers, his = (relative(found, place) for found in (child, mother, father))
        found = mixed(mine, hers, his)
        assert found in (word, "mutation")
        seen += found == word
        alike = (mine.body["graph.half"] == his.body["graph.half"]).all(1)
        own += bool((alike & reaches[place]).any()) and found == GRAFTED
    assert seen > COUNT / 2
    assert own > 2 or name == "cross"
