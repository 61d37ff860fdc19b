"""The record of births in a run of bodies that grow, and the lines that are read from it."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mjxgait.errors import UserError
from mjxgait.evolution.state import Origin
from mjxgait.inspect.family import Family, body_changes
from mjxgait.training.family import drop_newborns, keep_newborns, read_newborns
from mjxgait.training.logs import read_metrics, write_lines
from mjxgait.training.loop import _forget

NODES, CONNECTIONS = 3, 2


def graph(size: float) -> dict[str, np.ndarray]:
    """A chain of two blocks, the second of this half size in m."""
    each = (NODES, CONNECTIONS)
    used = np.zeros(each, bool)
    used[0, 0] = True
    half = np.full((NODES, 3), 0.1)
    half[1] = size
    return {
        "half": half,
        "joint": np.ones(NODES, int),
        "swing": np.full((NODES, 3), 0.5),
        "recursion": np.zeros(NODES, int),
        "target": np.ones(each, int),
        "used": used,
        "place": np.tile([1.0, 0.0, 0.0], (*each, 1)),
        "turn": np.zeros((*each, 3)),
        "scale": np.ones(each),
        "mirror": np.zeros(each, int),
        "terminal": np.zeros(each, bool),
    }


def state(generation: int, sizes: list[float], born: list[int], origin: list[int]) -> Any:
    """A population of bodies by the size of the second block."""
    graphs = [graph(size) for size in sizes]
    leaves = {name: np.stack([one[name] for one in graphs]) for name in graphs[0]}
    fitness = np.float32(10 * generation - np.arange(len(sizes)))
    given = {"born": np.array(born), "origin": np.array(origin), "fitness": fitness}
    return SimpleNamespace(genomes={"graph": leaves}, generation=np.int32(generation), **given)


LINES = [
    {"generation": 0, "mothers": [-1, -1], "fathers": [-1, -1]},
    {"generation": 1, "mothers": [1, 0], "fathers": [-1, -1]},
    {"generation": 2, "mothers": [0, 0], "fathers": [-1, 1]},
    {"generation": 3, "mothers": [1, 0], "fathers": [-1, -1]},
]
STATES = [
    state(0, [0.1, 0.2], [0, 0], [Origin.INITIAL] * 2),
    state(1, [0.21, 0.1], [1, 0], [Origin.MUTATION, Origin.INITIAL]),
    state(2, [0.21, 0.05], [1, 2], [Origin.MUTATION, Origin.CROSSOVER]),
    state(3, [0.05, 0.21], [2, 1], [Origin.CROSSOVER, Origin.MUTATION]),
]
"""The second is the mother of the first child, the mother of the last generation's best."""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    for one in STATES:
        keep_newborns(tmp_path, one)
    return tmp_path


def test_every_individual_is_found_with_the_body_that_it_had(run: Path):
    family = Family(run, LINES)
    for one in STATES:
        for place, half in enumerate(one.genomes["graph"]["half"]):
            found = family.individual(int(one.generation), place)
            assert found is not None
            assert found.generation == one.born[place]
            np.testing.assert_array_equal(found.body["graph.half"], half)


def test_a_line_leads_from_the_first_generation_to_the_champion(run: Path):
    births = Family(run, LINES).line(3, 0)
    assert [(b.child.generation, b.child.place) for b in births] == [(0, 1), (1, 0), (2, 1)]
    assert [b.operator for b in births] == ["first generation", "mutation", "mutation"]
    assert [b.child.fitness for b in births] == [-1.0, 10.0, 19.0]
    assert births[2].mother is not None
    assert births[2].mother.generation == 1
    assert births[2].father is None, "a father that left nothing is not shown"


def test_only_changes_of_the_body_that_are_seen_are_steps(run: Path):
    steps = body_changes(Family(run, LINES).line(3, 0), 4, 4)
    assert [(step.birth.child.generation, step.change) for step in steps] == [
        (0, "2 blocks"),
        (1, "sizes"),
        (2, "sizes"),
    ]
    near = dataclasses.replace(steps[0].birth.child, body=body(0.2003))
    births = [steps[0].birth, dataclasses.replace(steps[1].birth, child=near)]
    assert len(body_changes(births, 4, 4)) == 1


def body(size: float) -> dict[str, np.ndarray]:
    return {f"graph.{name}": np.asarray(array, float) for name, array in graph(size).items()}


def test_a_line_ends_where_the_record_begins(run: Path):
    """An older version began the run: the first ancestor that is known begins the tree."""
    (run / "family" / "0.npz").unlink()
    births = Family(run, LINES).line(3, 0)
    assert [b.child.generation for b in births] == [1, 2]
    assert births[0].mother is None


def test_a_run_without_a_record_is_told_in_a_sentence(tmp_path: Path):
    with pytest.raises(UserError, match="no family tree: it has no record of births"):
        Family(tmp_path, LINES).line(3, 0)


def test_a_damaged_record_is_refused(run: Path):
    (run / "family" / "1.npz").write_bytes(b"PK nothing")
    with pytest.raises(UserError, match=r"1\.npz: damaged"):
        Family(run, LINES).line(3, 0)


def test_a_body_that_does_not_grow_has_no_record(tmp_path: Path):
    plain = SimpleNamespace(**{**vars(STATES[0]), "genomes": {"key_poses": np.zeros((2, 3))}})
    keep_newborns(tmp_path, plain)
    assert not [*tmp_path.iterdir()]


def test_a_resumed_run_keeps_the_record_up_to_its_checkpoint_and_writes_the_same_again(run: Path):
    before = {path.name: path.read_bytes() for path in (run / "family").iterdir()}
    write_lines(
        run / "metrics.jsonl",
        [{"best": 0.0, "mean": 0.0, "forced": False} | line for line in LINES],
    )
    _forget(run, 1)
    assert [line["generation"] for line in read_metrics(run / "metrics.jsonl")] == [0, 1]
    assert read_newborns(run, 2) is None
    assert read_newborns(run, 1) is not None
    for one in STATES[2:]:
        keep_newborns(run, one)
    assert {path.name: path.read_bytes() for path in (run / "family").iterdir()} == before
    drop_newborns(run, -1)
    assert not [*(run / "family").iterdir()]
