"""`mjxgait inspect` on populations of bodies that grow."""

import dataclasses
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controllers.sims_brain.made_up import random_graphs
from rich.console import Console

from mjxgait.api import load_creature
from mjxgait.controllers.sims_brain.report import GraphView
from mjxgait.inspect.snapshot import Snapshot
from mjxgait.plugins import resolve_config

POPULATION = 6


def snapshot(seed: int, count: int = POPULATION) -> Snapshot:
    """The first `count` of random graphs, as a checkpoint holds them."""
    creature, graphs = load_creature("blocks"), random_graphs(seed)
    arrays = {
        f"genomes.graph.{field.name}": np.asarray(getattr(graphs, field.name))[:count]
        for field in dataclasses.fields(graphs)
    }
    arrays["fitness"] = np.zeros(count)
    config, nothing = resolve_config(creature.settings.train, creature.name), {}
    unused: Any = None
    return Snapshot(Path("run"), unused, creature, config, arrays, [], [0], nothing, 0.0, 0)


@pytest.fixture
def console() -> Console:
    return Console(file=io.StringIO(), width=120)


def said_on(console: Console) -> str:
    file = console.file
    assert isinstance(file, io.StringIO)
    return file.getvalue()


def test_the_parts_of_the_best_body_are_printed(console: Console):
    view, found = GraphView(), snapshot(0)
    facts = view.facts(found, 0)
    parts: Any = facts["parts"]
    assert parts[0]["parent"] == -1
    view.show({"rank": 1, "fitness": 0.0, **facts}, view.spread(found), console)
    said = said_on(console)
    assert "the body that grows" in said
    assert said.count(" x ") == 2 * len(parts)
    assert "parts in the mean" in said


def test_the_spread_is_the_number_of_parts():
    view, found = GraphView(), snapshot(0)
    bodies: list[Any] = [view.facts(found, i)["parts"] for i in range(POPULATION)]
    counts = [len(parts) for parts in bodies]
    assert view.spread(found) == {"parts": {"mean": np.mean(counts), "most": max(counts)}}


def test_two_populations_share_the_individuals_that_both_have(console: Console):
    view, first = GraphView(), snapshot(0)
    same = view.difference(first, snapshot(0))
    assert same["same_individuals"] == POPULATION
    assert view.difference(first, snapshot(1))["same_individuals"] == 0
    view.show_difference(same, console)
    assert "6 genomes are in both populations." in said_on(console)
    assert "champion of B" in said_on(console)


def test_genomes_of_other_shapes_are_not_compared(console: Console):
    """A version with another array."""
    view, first = GraphView(), snapshot(0)
    more = {**first.arrays, "genomes.graph.more": np.zeros((POPULATION, 2))}
    found = view.difference(dataclasses.replace(first, arrays=more), snapshot(0))
    assert found["same_individuals"] is None
    view.show_difference(found, console)
    assert "The genomes differ in shape" in said_on(console)
