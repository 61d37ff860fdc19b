"""Runs of an easier task that come first: their best begin a run (`evolution.ancestors`)."""

import dataclasses
import io
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from helpers import STOOL, made_up_evaluate, said_by, small_config
from rich.console import Console

from mjxgait.api.make import evolve, load_creature
from mjxgait.api.multi_seed import evolve_seeds
from mjxgait.config.schema import Config
from mjxgait.controllers.sims_brain.config import BrainConfig
from mjxgait.creature import Creature
from mjxgait.distributed import scheduler
from mjxgait.distributed.jobs import Programs
from mjxgait.distributed.rows import Rows
from mjxgait.errors import UserError
from mjxgait.experiments.ancestors import (
    evolve_ancestors,
    first_genomes,
    settings_of_ancestors,
)
from mjxgait.experiments.multi_seed import create_multi_seed, folders_of
from mjxgait.output import Output
from mjxgait.plugins import resolve_config
from mjxgait.training import stages
from mjxgait.training.experiment import arrays_of, build_experiment
from mjxgait.training.folder import ANCESTORS, METRICS, create_run, open_run
from mjxgait.training.initial import INITIAL, initial_of, planted, read_initial, united
from mjxgait.training.logs import read_metrics
from mjxgait.training.screen import Screen
from mjxgait.training.stored import read_stored

FEW = {"runs": 2, "task": "walk", "population": 4, "generations": 2}


@pytest.fixture(scope="module", autouse=True)
def nothing_is_simulated() -> Iterator[None]:
    """All ancestors share their compiled programs, as in a process that evolves several runs."""
    programs = Programs()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "evaluate", made_up_evaluate)
        patch.setattr(scheduler, "Programs", lambda: programs)
        yield


def config(**few: object) -> Config:
    return small_config(
        evolution={"ancestors": FEW | few}, examination={"candidates": 0}, drive={"stiffness": 0.5}
    )


def train(folder: Path, creature: Creature, settings: Config, resume: bool = False) -> bool:
    begin = (lambda: None) if resume else partial(create_run, folder, creature, settings)
    screen = Screen(Console(file=io.StringIO()))
    return evolve(folder, creature, settings, screen, resume=resume, begin=begin)


def bests(folder: Path) -> list[float]:
    return [line["best"] for line in read_metrics(folder / METRICS)]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, stool: Creature) -> Path:
    folder = tmp_path_factory.mktemp("ancestors") / "run"
    settings = dataclasses.replace(config(), seed=3)
    assert train(folder, stool, settings)
    return folder


def test_a_run_begins_with_the_best_of_each_ancestor(finished: Path, stool: Creature):
    first, (one, other) = read_initial(finished), folders_of(finished / ANCESTORS)
    assert first is not None
    for place, run in ((0, one), (1, other)):
        best = read_stored(run, stool.digest).arrays["genomes.key_poses"][0]
        np.testing.assert_array_equal(first["key_poses"][place], best)


def test_ancestors_have_their_own_seeds_task_and_size(finished: Path):
    for number, folder in enumerate(folders_of(finished / ANCESTORS)):
        _, own = open_run(folder)
        assert (own.seed, own.use.task, own.evolution.ancestors.runs) == (6 + number, "walk", 0)
        assert (own.evolution.population, own.evolution.generations) == (4, 2)
        assert own.drive.stiffness == 1.0, "the creature's own settings for the task"


def killed_before_anything(folder: Path) -> None:
    shutil.rmtree(folder / ANCESTORS)


def killed_while_the_folder_was_made(folder: Path) -> None:
    (folder / ANCESTORS / "zoo.toml").unlink()


def killed_during_the_ancestors(folder: Path) -> None:
    for run in folders_of(folder / ANCESTORS):
        shutil.rmtree(run / "checkpoints")


def killed_afterwards(folder: Path) -> None:
    pass


@pytest.mark.parametrize(
    "kill",
    [
        killed_before_anything,
        killed_while_the_folder_was_made,
        killed_during_the_ancestors,
        killed_afterwards,
    ],
)
def test_a_killed_run_resumes_to_the_same_result(
    kill, finished: Path, tmp_path: Path, stool: Creature
):
    folder = shutil.copytree(finished, tmp_path / "run")
    shutil.rmtree(folder / "checkpoints")
    (folder / INITIAL).unlink()
    kill(folder)
    assert train(folder, stool, dataclasses.replace(config(), seed=3), resume=True)
    assert read_metrics(folder / METRICS)[-1]["best"] == bests(finished)[-1]
    now, before = (read_stored(run, stool.digest).arrays for run in (folder, finished))
    np.testing.assert_array_equal(now["genomes.key_poses"], before["genomes.key_poses"])


def test_damaged_ancestors_name_the_way_out(finished: Path, tmp_path: Path, stool: Creature):
    settings, place = open_run(finished)[1], tmp_path / ANCESTORS
    shutil.copytree(finished / ANCESTORS, place)
    shutil.rmtree(next(place.glob("seed*")))
    with pytest.raises(UserError, match=f"take {place} away to evolve"):
        evolve_ancestors(tmp_path, stool, settings, print)
    (place / "zoo.toml").write_text("seeds = 3")
    with pytest.raises(UserError, match=f"take {place} away to evolve"):
        evolve_ancestors(tmp_path, stool, settings, print)


def test_a_run_that_has_begun_needs_no_ancestors(finished: Path, tmp_path: Path, stool: Creature):
    folder = shutil.copytree(finished, tmp_path / "run")
    shutil.rmtree(folder / ANCESTORS)
    assert train(folder, stool, dataclasses.replace(config(), seed=3), resume=True)
    assert not (folder / ANCESTORS).exists()


def test_an_interrupted_run_goes_on_with_its_ancestors(
    finished: Path, tmp_path: Path, stool: Creature, monkeypatch: pytest.MonkeyPatch
):
    settings = dataclasses.replace(config(), seed=3)
    with monkeypatch.context() as patch:
        patch.setattr(Rows, "to_the_end", lambda *args: None)
        assert not train(tmp_path / "run", stool, settings)
    assert not (tmp_path / "run" / INITIAL).exists()
    assert train(tmp_path / "run", stool, settings, resume=True)
    assert bests(tmp_path / "run") == bests(finished)


def test_several_runs_have_ancestors_of_their_own(tmp_path: Path, stool: Creature):
    zoo = create_multi_seed(tmp_path / "zoo", stool, dataclasses.replace(config(), seed=3), 2)
    folders = folders_of(zoo)
    first = first_genomes(folders, stool, lambda said: None)
    assert first is not None
    for row, folder in enumerate(folders):
        own = read_initial(folder)
        assert own is not None
        poses = first["genomes.key_poses"][row]
        np.testing.assert_array_equal(poses, own["key_poses"][: len(poses)])
    assert 1 <= first["genomes.key_poses"].shape[1] <= 6
    assert not np.array_equal(*first["genomes.key_poses"])
    again = first_genomes(folders, stool, pytest.fail)
    assert again is not None
    np.testing.assert_array_equal(again["genomes.key_poses"], first["genomes.key_poses"])


def test_runs_side_by_side_begin_with_their_ancestors(
    tmp_path: Path, stool: Creature, monkeypatch: pytest.MonkeyPatch
):
    zoo, begun = tmp_path / "zoo", []

    def noted(rows: Rows, *given: object) -> object:
        begun.append(rows.planted)
        return None if rows.planted else to_the_end(rows, *given)

    to_the_end = Rows.to_the_end
    monkeypatch.setattr(Rows, "to_the_end", noted)
    begin = partial(create_multi_seed, zoo, stool, config(), 2)
    assert not evolve_seeds(zoo, Output(quiet=True), begin=begin)
    assert begun[:2] == [None, None], "ancestors of one run after another"
    own = [read_initial(folder) or {} for folder in folders_of(zoo)]
    for poses, genomes in zip(begun[2]["genomes.key_poses"], own, strict=True):
        np.testing.assert_array_equal(poses, genomes["key_poses"][: len(poses)])


def test_runs_without_ancestors_begin_as_drawn(tmp_path: Path, stool: Creature):
    zoo = create_multi_seed(tmp_path / "zoo", stool, config(runs=0), 2)
    assert first_genomes(folders_of(zoo), stool, pytest.fail) == {}


def test_a_folder_of_runs_is_united_with_the_best_first(finished: Path, stool: Creature):
    runs = folders_of(finished / ANCESTORS)
    both, (one, other) = united(runs), (initial_of(run) for run in runs)
    poses = both.genomes["key_poses"]
    np.testing.assert_array_equal(poses[0], one.genomes["key_poses"][0])
    np.testing.assert_array_equal(poses[1], other.genomes["key_poses"][0])
    np.testing.assert_array_equal(poses[2], one.genomes["key_poses"][1])
    alone = united([runs[0], runs[0]]).genomes["key_poses"]
    assert len(alone) == 2 * len(one.genomes["key_poses"])


def test_weights_of_a_light_stay_as_drawn_after_a_task_without_one():
    blocks = load_creature("blocks")
    steered = dataclasses.replace(BrainConfig(), steer=True)
    dark, lit = (
        dataclasses.replace(
            resolve_config(blocks.settings.train, "blocks", use={"task": task}), controller=steered
        )
        for task in ("swim", "follow")
    )
    swim, follow = (build_experiment(blocks, settings) for settings in (dark, lit))
    assert swim.simulator.controller.genes_of["light"] == ("nerves.steer",)
    state, came = follow.init(), swim.init()
    idle = swim.simulator.controller.genes_of["light"]
    genomes = {n: array for n, array in arrays_of(came.genomes).items() if n not in idle}
    made = planted(state, genomes, follow.simulator.controller)
    with pytest.raises(UserError, match="do not fit the settings"):
        planted(state, {n: a for n, a in genomes.items() if n != "graph.half"})
    np.testing.assert_array_equal(made.genomes.nerves.steer, state.genomes.nerves.steer)
    np.testing.assert_array_equal(made.genomes.graph.half, came.genomes.graph.half)


def test_followers_come_from_runs_without_a_light():
    blocks = load_creature("blocks")
    for task, before, mode in (("follow", "swim", "swim"), ("follow-on-land", "walk", "roam")):
        settings = resolve_config(blocks.settings.train, "blocks", use={"task": task})
        chosen = settings.evolution.ancestors
        assert (chosen.task, chosen.runs, settings.controller.steer) == (before, 6, True)
        own = settings_of_ancestors(blocks, settings)
        assert (own.use.task, own.controller.steer) == (mode, True)
        assert own.evolution.survival == "best", "of the easier task"
        assert own.rollout.starts == 1, "the task itself has two"


@pytest.mark.parametrize(("before", "skill"), [("swim", 0), ("walk", 1)])
def test_ancestors_of_several_skills_use_the_effectors_of_theirs(before: str, skill: int):
    blocks = load_creature("blocks")
    settings = resolve_config(blocks.settings.train, "blocks", use={"task": "amphibian"})
    ancestors = dataclasses.replace(settings.evolution.ancestors, task=before)
    evolution = dataclasses.replace(settings.evolution, ancestors=ancestors)
    own = settings_of_ancestors(blocks, dataclasses.replace(settings, evolution=evolution))
    assert (own.controller.skills, own.controller.skill) == (2, skill)


@pytest.mark.parametrize(("choice", "drawn"), [(0, 8), (3, 3)])
def test_ancestors_choose_among_random_bodies(choice: int, drawn: int):
    """0 is the choice of their task. The run itself chooses none."""
    blocks = load_creature("blocks")
    settings = resolve_config(
        blocks.settings.train | {"evolution": {"ancestors": {"initial_choice": choice}}},
        "blocks",
        use={"task": "follow"},
    )
    assert settings.evolution.initial_choice == 1
    assert settings_of_ancestors(blocks, settings).evolution.initial_choice == drawn


def test_islands_and_studies_begin_as_drawn(capsys, tmp_path: Path):
    follow = ("train", "--env", "blocks", "--task", "follow", "--out", tmp_path / "run")
    said = said_by(capsys, *follow, "--evolution.islands.count", 2, code=2)
    assert "give --evolution.ancestors.runs 0" in said
    assert not (tmp_path / "run").exists()
    study = tmp_path / "study.toml"
    study.write_text(
        f'question = "?"\nenv = "{STOOL}"\n[[variant]]\nname = "a"\n[[variant]]\nname = "b"\n'
        "settings.evolution.ancestors.runs = 2\n"
    )
    said = said_by(capsys, "ablate", study, "--out", tmp_path / "study", code=2)
    assert "begin with drawn individuals, not with ancestors" in said


@pytest.mark.parametrize("runs", [(), ("--runs", 2)])
def test_an_unknown_task_is_refused_before_a_folder_is_made(runs, capsys, tmp_path: Path):
    follow = ("train", "--env", "blocks", "--task", "follow", "--out", tmp_path / "run", *runs)
    said = said_by(capsys, *follow, "--evolution.ancestors.task", "fly", code=2)
    assert "fly" in said
    assert not (tmp_path / "run").exists()


def test_a_single_ancestor_is_refused():
    with pytest.raises(UserError, match="give 2 or more, or 0 for none"):
        config(runs=1)
