"""A run by the evolution strategy: resumed, as a row of several, and refused."""

import dataclasses
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from helpers import STOOL, made_up_evaluate, said_by, small_config
from rich.console import Console

from mjxgait.config.evolution import RestartConfig
from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.inspect import individual_facts, read_snapshot
from mjxgait.training import loop, stages
from mjxgait.training.experiment import build_batch
from mjxgait.training.folder import create_run, open_run
from mjxgait.training.logs import read_metrics
from mjxgait.training.screen import Screen
from mjxgait.training.stored import read_stored
from mjxgait.types import by_name


@pytest.fixture(scope="module", autouse=True)
def nothing_is_simulated() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "evaluate", made_up_evaluate)
        yield


def config(generations: int = 6, seed: int = 0) -> Config:
    plain = small_config(
        evolution={"search": "es", "generations": generations, "population": 12},
        rollout={"starts": 2, "promote": 0.5},
        examination={"candidates": 0},
    )
    return dataclasses.replace(plain, seed=seed)


def train(folder: Path, creature: Creature, config: Config, resume: bool = False) -> Path:
    screen = Screen(Console(file=io.StringIO()))
    begin = lambda: None if resume else create_run(folder, creature, config)  # noqa: E731
    assert loop.train(folder, creature, config, screen, resume, begin=begin)
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, stool: Creature) -> Path:
    return train(tmp_path_factory.mktemp("whole") / "run", stool, config())


def test_the_strategy_improves_and_its_run_says_so(whole: Path):
    best = [line["best"] for line in read_metrics(whole / "metrics.jsonl")]
    assert best[-1] > best[0]
    assert open_run(whole)[1].evolution.search == "es"


def test_a_run_of_the_strategy_can_be_inspected(whole: Path):
    individual = individual_facts(read_snapshot(whole), 1)
    assert individual["kind"] == "drawn"


def test_a_resumed_run_ends_with_the_same_bits(whole: Path, stool: Creature, tmp_path: Path):
    part = train(tmp_path / "run", stool, config(generations=3))
    train(part, stool, config(), resume=True)
    one, two = (read_stored(run, stool.digest).arrays for run in (whole, part))
    assert "normal.mean" in one
    for name, array in one.items():
        np.testing.assert_array_equal(array, two[name], err_msg=name)


@pytest.mark.parametrize("search", ["ga", "es"])
def test_a_run_that_begins_again_is_resumed_with_the_same_bits(
    search: Literal["ga", "es"], stool: Creature, tmp_path: Path
):
    """It stops in the generation after which the population is drawn anew."""

    def again(generations: int) -> Config:
        plain = config(generations)
        own: dict[str, Any] = {"search": search, "restart": RestartConfig(every=3, below=1e9)}
        if search == "ga":
            own["population"] = 6  # the programs of `test_run.SMALL`, so the cache has them
        return dataclasses.replace(plain, evolution=dataclasses.replace(plain.evolution, **own))

    straight = train(tmp_path / "straight", stool, again(5))
    part = train(tmp_path / "part", stool, again(3))
    train(part, stool, again(5), resume=True)
    one, two = (read_stored(run, stool.digest).arrays for run in (straight, part))
    assert one["born"].min() > 3, "nothing of the first population is left"
    for name, array in one.items():
        np.testing.assert_array_equal(array, two[name], err_msg=name)


def test_a_row_of_several_is_the_run_alone(whole: Path, stool: Creature):
    """But for rounding, which differs between programs (docs/guide/studies.md)."""
    batch = build_batch(stool, [config(seed=3), config()])
    step, states = batch.compile(), batch.place(batch.init())
    while np.max(states.generation) < 6:
        states, _ = step(states)
    alone = read_stored(whole, stool.digest).arrays
    for name, array in by_name(states.normal).items():
        np.testing.assert_allclose(array[1], alone[f"normal.{name}"], 1e-4, 1e-6, err_msg=name)
    assert not np.array_equal(states.normal.mean[0], states.normal.mean[1])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--env", STOOL, "--use.controller", "program"), "those of the controller program"),
        (("--env", "blocks"), "those of the controller brain"),
    ],
    ids=["expressions", "bodies that grow"],
)
def test_what_is_no_box_of_reals_is_refused(
    arguments: tuple[object, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture
):
    out = tmp_path / "out"
    assert said in said_by(capsys, "train", *arguments, "--search", "es", "--out", out, code=2)
    assert not out.exists()
