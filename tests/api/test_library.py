"""The Python API: what the command line does, from Python."""

import json
import logging.handlers
import pydoc
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import SHORT, STOOL, short_examination, small_config

import mjxgait
from mjxgait.creature import Creature
from mjxgait.creature.scale import scaled
from mjxgait.errors import UserError
from mjxgait.output import LOG
from mjxgait.training.experiment import build_experiment
from mjxgait.training.loop import _COMPILED

SMALL = {
    "rollout": {"seconds": 0.4, "starts": 2, "promote": 1.0, "lanes": 4},
    "examination": {"candidates": 1, "draws": 2},
}


@pytest.fixture(scope="module", autouse=True)
def short() -> Iterator[None]:
    """Examinations of 3 s; full ones take ten times as long."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mjxgait.certification.certificate.CertificateConfig", short_examination)
        yield


@pytest.fixture(scope="module")
def lines() -> list[dict]:
    """The lines that the run passed on while it ran."""
    return []


@pytest.fixture(scope="module")
def records() -> list[logging.LogRecord]:
    """What the run logged."""
    return []


@pytest.fixture(scope="module")
def run(tmp_path_factory, lines: list[dict], records: list[logging.LogRecord]) -> mjxgait.Run:
    folder = tmp_path_factory.mktemp("runs") / "x"
    handler = logging.handlers.QueueHandler(SimpleNamespace(put_nowait=records.append))
    LOG.addHandler(handler)
    LOG.setLevel(logging.DEBUG)
    try:
        _COMPILED.clear()  # of other tests in this process
        return mjxgait.train(
            STOOL,
            out=folder,
            seed=3,
            population=6,
            generations=2,
            settings=SMALL,
            quiet=True,
            on_generation=lines.append,
        )
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(logging.NOTSET)


def test_each_generation_is_passed_on_and_logged(
    run: mjxgait.Run, lines: list[dict], records: list[logging.LogRecord]
):
    logged = (run.folder / "metrics.jsonl").read_text().splitlines()
    assert lines == [json.loads(line) for line in logged]
    told = {level: [] for level in (logging.DEBUG, logging.INFO)}
    for record in records:
        told[record.levelno].append(record.getMessage())
    assert "Compiling…" in told[logging.INFO]
    assert sum(text.startswith("generation ") for text in told[logging.INFO]) == len(lines) == 3
    assert any(text.startswith("evaluate: compiled") for text in told[logging.DEBUG])


def test_a_run_has_the_contents_of_its_folder(run: mjxgait.Run):
    assert (run.creature.name, run.config.seed, run.config.rollout.lanes) == ("stool", 3, 4)
    document = json.loads((run.folder / "champion.json").read_text())
    assert run.champion.fitness == document["fitness"]
    assert run.certificate == json.loads((run.folder / "certificate.json").read_text())
    assert run.certified == run.certificate["passed"]
    assert mjxgait.open(run.folder) == run


def test_a_second_run_of_the_same_shape_compiles_nothing(
    run: mjxgait.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Seed and weights are data of the program; the first run, repeated, gives the same result."""

    def compiled(*_: object) -> None:
        raise AssertionError("compiled anew")

    monkeypatch.setattr("mjxgait.training.experiment.compile_stages", compiled)
    other = SMALL | {"fitness": {"weights": {"slip": 3.0}}}
    mjxgait.train(
        STOOL, out=tmp_path / "x", seed=4, population=6, generations=1, settings=other, quiet=True
    )
    again = mjxgait.train(
        STOOL, out=tmp_path / "y", seed=3, population=6, generations=2, settings=SMALL, quiet=True
    )
    assert again.champion.fitness == run.champion.fitness


def test_another_body_or_shape_has_its_own_programs(stool: Creature):
    other = scaled(stool, {"*_left": 1.2})
    shapes = [
        build_experiment(body, small_config(**tables)).shape
        for body, tables in (
            (stool, {}),
            (other, {}),
            (stool, {"controller": {"key_poses": 3}}),
            (stool, {"rollout": {"starts": 3}}),
        )
    ]
    assert len(set(shapes)) == len(shapes)
    assert build_experiment(stool, small_config(fitness={"speed": 0.7})).shape == shapes[0]


def test_metrics_are_columns_over_generations(run: mjxgait.Run):
    found = run.metrics()
    assert np.array_equal(found["generation"], [0, 1, 2])
    assert np.isfinite(found["best"]).all()
    assert {len(column) for column in found.values()} == {3}


def test_a_walk_is_columns_over_time(run: mjxgait.Run):
    columns = mjxgait.walk(run, seconds=0.5)
    rows = len(columns["time"])
    assert {column.shape for column in columns.values()} == {(rows,)}
    assert np.allclose(np.diff(columns["time"]), run.creature.model.opt.timestep)
    feet, joints = run.creature.feet.names, run.creature.joints.names
    assert {f"force_{foot}" for foot in feet} | {f"torque_{j}" for j in joints} <= set(columns)
    # The feet together carry about its weight.
    force = sum(columns[f"force_{foot}"] for foot in feet)
    assert force.mean() == pytest.approx(9.81 * run.creature.frame.mass, rel=0.3)


def test_a_repeated_examination_gives_the_same_certificate(run: mjxgait.Run, tmp_path: Path):
    (tmp_path / "short.toml").write_text(SHORT)
    again = json.loads(mjxgait.examine(run, tmp_path / "short.toml").to_json())
    assert {**again, "seconds": 0} == {**run.certificate, "seconds": 0}


def test_nothing_is_overwritten(run: mjxgait.Run):
    before = {p: p.read_bytes() for p in run.folder.rglob("*") if p.is_file()}
    with pytest.raises(UserError, match="holds another run"):
        mjxgait.train(STOOL, out=run.folder, settings=SMALL, quiet=True)
    assert before == {p: p.read_bytes() for p in run.folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: mjxgait.train("mule"), 'unknown creature "mule"'),
        (lambda: mjxgait.train(STOOL, settings={"rolout": {}}), 'did you mean "rollout"'),
        (lambda: mjxgait.train(STOOL, population=1), "population must be at least 2"),
        (lambda: mjxgait.train(STOOL, controller="my.py:Spin"), "no such file"),
        (lambda: mjxgait.refine(STOOL, "no.glb"), "no such file"),
        (lambda: mjxgait.refine(STOOL, "no.blend"), "glTF binary"),
        (lambda: mjxgait.open("nowhere"), "no such folder"),
        (lambda: mjxgait.walk("nowhere"), "no such folder"),
        (lambda: mjxgait.open(5), "5: name a file or a folder"),
        (lambda: mjxgait.train(STOOL, config={}, out=5), "5: name a file or a folder"),
        (lambda: mjxgait.train(STOOL, config={"seed": 1}), "name a file or a folder"),
        (lambda: mjxgait.train(STOOL, seed=2**32), "seed = 4294967296"),
    ],
    ids=[
        *("creature", "key", "range", "controller", "keys", "kind", "folder", "walk"),
        *("number", "out", "config", "seed"),
    ],
)
def test_a_mistake_is_one_sentence(call, words: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=words):
        call()
    assert list(tmp_path.iterdir()) == []


def test_help_covers_the_public_api():
    """It lists all public names with their arguments, results and errors."""
    text = pydoc.plain(pydoc.render_doc(mjxgait))
    for name in mjxgait.__all__:
        assert name in text
        assert pydoc.getdoc(getattr(mjxgait, name))
    for words in ("train(", "generations:", "Raises:", "mjxgait.walk(run)"):
        assert words in text
