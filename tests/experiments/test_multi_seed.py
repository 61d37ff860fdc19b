"""Multi-seed training: a run folder for each seed, and all champions in one picture.

Stand-in workers evolve the runs. The tests of rows compare a row with the run of its seed alone.
"""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from experiments.repertoire.made_up import certificate
from helpers import STOOL, said_by, small_config
from made_up_hands import Interrupted, Pretend
from rendering.made_up import treading

from mjxgait.champion import write_champion
from mjxgait.creature import Creature
from mjxgait.distributed.rows import Rows
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.experiments.multi_seed import create_multi_seed, folders_of, read_seeds
from mjxgait.experiments.repertoire.grid import POSES
from mjxgait.experiments.seeds_compared import found_in
from mjxgait.training.folder import CERTIFICATE, CHAMPION, METRICS, open_run
from mjxgait.training.logs import read_metrics
from mjxgait.training.stored import read_stored, stored_generations

SEEDS = (5, 6, 7)


def begun(zoo: Path, creature: Creature, together: int = 0) -> Path:
    """Begin runs that would each end early if run alone."""
    config = small_config(evolution={"target": 1e-3, "generations": 4}, examination={"every": 2})
    config = dataclasses.replace(config, seed=5, checkpoint_every=1)
    return create_multi_seed(zoo, creature, config, len(SEEDS), together)


def go_on(zoo: Path, creature: Creature, kind: type[Scheduler] = Scheduler) -> bool:
    seeds = read_seeds(zoo)
    folders, together = seeds.folders(zoo), seeds.together
    rows = Rows(creature, folders, lambda *told: None, keep_every=1, together=together)
    return rows.to_the_end(kind(Pretend()), lambda: False) is not None


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, stool: Creature) -> Path:
    zoo = begun(tmp_path_factory.mktemp("zoo") / "three", stool)
    assert go_on(zoo, stool)
    return zoo


def test_each_seed_runs_to_its_last_generation(finished: Path):
    folders = folders_of(finished)
    assert [folder.name for folder in folders] == [f"seed{seed}" for seed in SEEDS]
    for seed, folder in zip(SEEDS, folders, strict=True):
        _, config = open_run(folder)
        assert config.seed == seed
        assert (config.evolution.target, config.examination.every) == (None, 0)
        assert [line["generation"] for line in read_metrics(folder / METRICS)] == [0, 1, 2, 3, 4]
        assert stored_generations(folder) == [1, 2, 3, 4]


def test_each_seed_starts_with_its_own_population(finished: Path, stool: Creature):
    poses = [read_stored(folder, stool.digest).arrays[POSES] for folder in folders_of(finished)]
    assert not np.array_equal(poses[0], poses[1])
    assert not np.array_equal(poses[1], poses[2])


def test_interrupted_runs_resume_to_the_same_result(
    finished: Path, tmp_path: Path, stool: Creature
):
    zoo = begun(tmp_path / "again", stool)
    assert not go_on(zoo, stool, Interrupted)
    last = read_metrics(folders_of(zoo)[0] / METRICS)[-1]
    with (folders_of(zoo)[0] / METRICS).open("a") as log:  # killed before the state was stored
        log.write(json.dumps(last | {"generation": last["generation"] + 1}) + "\n")
    assert go_on(zoo, stool)
    for one, again in zip(folders_of(finished), folders_of(zoo), strict=True):
        states = [read_stored(folder, stool.digest).arrays[POSES] for folder in (one, again)]
        np.testing.assert_array_equal(*states)
        assert read_metrics(one / METRICS) == read_metrics(again / METRICS)


def test_several_jobs_give_the_same_result_as_one(finished: Path, tmp_path: Path, stool: Creature):
    """Jobs of two runs and one; a stand-in worker treats each run independently."""
    zoo = begun(tmp_path / "pieces", stool, together=2)
    assert go_on(zoo, stool)
    for one, other in zip(folders_of(finished), folders_of(zoo), strict=True):
        states = [read_stored(folder, stool.digest).arrays[POSES] for folder in (one, other)]
        np.testing.assert_array_equal(*states)
        assert read_metrics(one / METRICS) == read_metrics(other / METRICS)


@pytest.fixture(scope="module")
def examined(finished: Path, stool: Creature) -> Path:
    """The first run passed its examination, the second failed, the third has no champion."""
    for folder, passed in zip(folders_of(finished)[:2], (True, False), strict=True):
        write_champion(treading(stool), stool, folder / CHAMPION)
        (folder / CERTIFICATE).write_text(certificate(stool, passed))
    return finished


def test_all_champions_are_in_one_table(examined: Path):
    found = found_in(folders_of(examined))
    assert [one.certified for one in found] == [True, False, False]
    assert [one.verdict for one in found] == ["certified", "fails progress", "not examined"]


def test_resuming_examined_runs_shows_the_results_again(
    examined: Path, capsys: pytest.CaptureFixture
):
    (folders_of(examined)[2] / CERTIFICATE).write_text(
        (folders_of(examined)[1] / CERTIFICATE).read_text()
    )
    said = said_by(capsys, "train", "--resume", examined, code=0)
    assert "1 of 3 are certified" in said
    assert (examined / "zoo.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--runs", "1"], "give 2 or more"),
        (["--runs", "2", "--evolution.islands.count", "2"], "islands do not go side by side"),
        (["--runs", "2", "--view"], "no --view, no --log and no --generation"),
        (
            ["--runs", "2", "--tries", "3"],
            "new runs one after another, without --resume and --runs",
        ),
        (["--tries", "0"], "give 1 or more"),
    ],
)
def test_bad_input_gets_one_sentence(given: list[str], said: str, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert said in said_by(capsys, "train", "--env", STOOL, *given, code=2)
    assert not list(tmp_path.iterdir())


def test_resumed_runs_keep_their_settings(finished: Path, capsys: pytest.CaptureFixture):
    for given in (("--generations", 9), ("--runs", 4)):
        said = said_by(capsys, "train", "--resume", finished, *given, code=2)
        assert "keep their number, body and settings" in said
    said = said_by(capsys, "train", "--resume", finished, "--env", "crab", code=2)
    assert "leave --env out" in said


def test_a_folder_of_runs_names_one_where_one_is_wanted(finished: Path, capsys):
    said = said_by(capsys, "certify", finished, code=2)
    assert "a folder of runs, and this is for one" in said
    assert str(finished / "seed") in said


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture):
    (tmp_path / "mine.txt").write_text("mine")
    said = said_by(capsys, "train", "--env", STOOL, "--runs", "2", "--out", tmp_path, code=2)
    assert "holds something already" in said
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
