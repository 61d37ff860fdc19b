"""Metrics of runs as tables of pandas."""

import json
import sys
from pathlib import Path

import pytest
from helpers import STOOL, small_config

import mjxgait
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.extras import install_command
from mjxgait.training.folder import create_run

MISSING = {"best": None, "mean": None, "forced": False}


def made_up_run(folder: Path, seed: int, *lines: dict) -> Path:
    config = small_config()
    create_run(folder, load_creature(STOOL), type(config)(**{**vars(config), "seed": seed}))
    text = "".join(json.dumps({"generation": i} | line) + "\n" for i, line in enumerate(lines))
    (folder / "metrics.jsonl").write_text(text)
    return folder


def test_a_run_is_a_table_by_generation(tmp_path: Path):
    pandas = pytest.importorskip("pandas")
    lines = [MISSING | {"mothers": [1, 2]}, {"best": 2.5, "mean": 1.0, "forced": True, "level": 3}]
    table = mjxgait.open(made_up_run(tmp_path / "x", 4, *lines)).frame()
    assert table.index.name == "generation"
    assert list(table.columns) == ["best", "mean", "forced", "level"]
    assert table.best[1] == 2.5
    assert pandas.isna(table.best[0])
    assert pandas.isna(table.level[0])
    empty = mjxgait.open(made_up_run(tmp_path / "y", 4)).frame()
    assert (len(empty), empty.index.name) == (0, "generation")


def test_several_runs_are_one_table_with_their_seeds(tmp_path: Path):
    pytest.importorskip("pandas")
    one, two = (
        made_up_run(tmp_path / name, seed, *[MISSING | {"best": float(seed)}] * 2)
        for name, seed in (("x", 4), ("y", 7))
    )
    table = mjxgait.frames([one, mjxgait.open(two)])
    assert table.index.names == ["run", "generation"]
    assert table.loc[(str(two), 1), "best"] == 7
    assert table.groupby("run").seed.first().tolist() == [4, 7]
    with pytest.raises(UserError, match="name at least one run folder"):
        mjxgait.frames([])


def test_without_pandas_it_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UserError, match="tables need pandas: pip install") as said:
        mjxgait.open(made_up_run(tmp_path / "x", 4)).frame()
    assert install_command("pandas") in str(said.value)
