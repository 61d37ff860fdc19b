"""A run that begins with the last population of another (`train --from`)."""

import dataclasses
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from helpers import STOOL, made_up_evaluate, said_by, small_config
from rich.console import Console

import mjxgait
from mjxgait.config.schema import Config
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.training import loop, stages
from mjxgait.training.experiment import arrays_of, build_experiment
from mjxgait.training.folder import create_run
from mjxgait.training.initial import (
    INITIAL,
    Initial,
    check_initial,
    initial_of,
    planted,
    read_initial,
)
from mjxgait.training.logs import read_metrics
from mjxgait.training.screen import Screen
from mjxgait.training.stored import read_stored

NOT_EXAMINED = {"candidates": 0}


@pytest.fixture(scope="module", autouse=True)
def nothing_is_simulated() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "evaluate", made_up_evaluate)
        yield


def config(**tables: dict) -> Config:
    return small_config(examination=NOT_EXAMINED, **tables)


def train(folder: Path, creature: Creature, config: Config, source: Path | None = None) -> Path:
    initial = initial_of(source) if source else None
    screen = Screen(Console(file=io.StringIO()))
    begin = lambda: create_run(folder, creature, config)  # noqa: E731
    assert loop.train(folder, creature, config, screen, begin=begin, initial=initial)
    return folder


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory, stool: Creature) -> Path:
    return train(tmp_path_factory.mktemp("first") / "run", stool, config())


@pytest.fixture(scope="module")
def second(first: Path, stool: Creature) -> Path:
    return train(first.parent / "second", stool, config(), first)


def test_the_first_generation_is_as_good_as_the_last_of_the_other(first: Path, second: Path):
    before, after = (read_metrics(run / "metrics.jsonl") for run in (first, second))
    assert before[-1]["best"] > before[0]["best"]
    assert after[0]["best"] == before[-1]["best"]


def test_the_run_folder_holds_the_genomes(first: Path, second: Path, stool: Creature):
    last = read_stored(first, stool.digest).arrays
    kept = read_initial(second)
    assert kept is not None
    for name, array in kept.items():
        np.testing.assert_array_equal(array, last[f"genomes.{name}"])
    assert read_initial(first) is None


def test_a_run_killed_before_its_first_checkpoint_begins_again_alike(
    second: Path, stool: Creature, tmp_path: Path
):
    again, settings = tmp_path / "again", config()
    create_run(again, stool, settings)
    (again / INITIAL).write_bytes((second / INITIAL).read_bytes())
    screen = Screen(Console(file=io.StringIO()))
    assert loop.train(again, stool, settings, screen, resume=True)
    bests = [[line["best"] for line in read_metrics(r / "metrics.jsonl")] for r in (second, again)]
    assert bests[0] == bests[1]


def test_fewer_genomes_leave_the_rest_drawn(first: Path, stool: Creature):
    state = build_experiment(stool, config()).init()
    some = {name: array[:2] for name, array in initial_of(first).genomes.items()}
    made = planted(state, some)
    poses, drawn = (np.asarray(one.genomes.key_poses) for one in (made, state))
    np.testing.assert_array_equal(poses[:2], some["key_poses"])
    np.testing.assert_array_equal(poses[2:], drawn[2:])


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"controller": {"key_poses": 3}}, "its genomes have key_poses of shape"),
        ({"use": {"controller": "program"}}, "its controller is poses, that of the new run"),
    ],
)
def test_genomes_that_do_not_fit_are_refused_before_a_folder_is_made(
    tables: dict, said: str, first: Path, stool: Creature, tmp_path: Path
):
    use = tables.pop("use", {})
    settings = dataclasses.replace(config(**tables), use=dataclasses.replace(config().use, **use))
    with pytest.raises(UserError, match=said):
        train(tmp_path / "run", stool, mjxgait_config(settings), first)
    assert not (tmp_path / "run").exists()


def mjxgait_config(settings: Config) -> Config:
    """The same settings with a controller table of the right kind."""
    if settings.use.controller == "poses":
        return settings
    return mjxgait.plugins.resolve_config({"use": {"controller": "program"}}, "stool")


def test_another_body_is_refused(first: Path, tmp_path: Path):
    crab = load_creature(STOOL.parents[2] / "envs" / "crab")
    with pytest.raises(UserError, match="its body has other joints"):
        train(tmp_path / "run", crab, config(), first)


def test_genomes_of_a_brain_that_hears_more_children_are_refused():
    """Their arrays have the shapes of the new run, but the numbers of sources are others."""
    blocks = load_creature(STOOL.parents[2] / "envs" / "blocks")
    settings = mjxgait.plugins.resolve_config(blocks.settings.train, "blocks")
    hearing = dataclasses.replace(settings.controller, children=3)
    own = build_experiment(blocks, settings)
    other = build_experiment(blocks, dataclasses.replace(settings, controller=hearing))
    controller = own.simulator.controller
    genomes = arrays_of(own.init().genomes)
    came = Initial(Path("hens"), "brain", controller.reads, (), controller.meaning, genomes)
    check_initial(came, own)
    with pytest.raises(UserError, match=r"hens: .* controller\.children = 1, .* new run of 3"):
        check_initial(came, other)


def test_a_damaged_file_is_one_sentence(second: Path, tmp_path: Path):
    whole = (second / INITIAL).read_bytes()
    (tmp_path / INITIAL).write_bytes(whole[:100])
    with pytest.raises(UserError, match=f"^{tmp_path / INITIAL}: damaged"):
        read_initial(tmp_path)
    refused = []
    for place in range(40, len(whole), max(len(whole) // 60, 1)):
        changed = bytearray(whole)
        changed[place] ^= 0xFF
        (tmp_path / INITIAL).write_bytes(changed)
        try:
            read_initial(tmp_path)
        except UserError as error:
            refused.append(str(error))
    assert len(refused) > 30  # a byte of a name or a date may change unseen
    assert all(text.startswith(f"{tmp_path / INITIAL}: damaged") for text in refused)


def test_the_option_is_for_a_single_new_run(first: Path, capsys):
    said = said_by(capsys, "train", "--from", first, "--resume", first, code=2)
    assert said == "mjxgait: --from: for a single new run, without --resume and --runs\n"
