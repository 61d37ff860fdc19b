"""A repertoire of the smallest creature, from the first generation to the files for a game engine.

Stand-in workers evolve it, so that no program is compiled; `test_migrants.py` tests the rows.
"""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pygltflib as gltf
import pytest
from experiments.repertoire.made_up import CERTIFIED, GENERATIONS, begin, examine
from helpers import STOOL, said_by
from importer.rigs import glb
from made_up_hands import Interrupted, Pretend
from rendering.made_up import treading

from mjxgait.api import repertoires as command
from mjxgait.creature import Creature
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.experiments.repertoire.grid import POSES, Cell, Grid, evolve, mirrored
from mjxgait.experiments.repertoire.neighbours import half_way
from mjxgait.training.folder import METRICS
from mjxgait.training.logs import read_metrics
from mjxgait.training.stored import read_stored, stored_generations


def run(folder: Path, creature: Creature, grid: Grid, kind: type[Scheduler] = Scheduler) -> bool:
    scheduler = kind(Pretend())
    return evolve(folder, creature, grid, scheduler, lambda *told: None, lambda: False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Creature, Grid]:
    made = begin(tmp_path_factory.mktemp("repertoire") / "set")
    assert run(*made)
    return made


def poses_of(folder: Path, cell: Cell, creature: Creature) -> np.ndarray:
    return read_stored(folder / cell.name, creature.digest).arrays[POSES]


def test_each_walk_has_its_own_run(finished, capsys: pytest.CaptureFixture):
    folder, _, grid = finished
    said = said_by(capsys, "inspect", folder, code=0)
    for cell in grid.cells:
        assert cell.name in said
        lines = read_metrics(folder / cell.name / METRICS)
        assert [line["generation"] for line in lines] == [0, 1, 2]
        assert stored_generations(folder / cell.name)[-1] == GENERATIONS


def test_right_turns_are_mirror_images_of_left_turns(finished):
    folder, creature, grid = finished
    for speed in grid.speeds:
        left, right = (poses_of(folder, Cell(speed, turn), creature) for turn in (10.0, -10.0))
        np.testing.assert_array_equal(mirrored(left, creature), right)


def test_turning_walks_start_from_the_straight_poses(finished):
    """The checkpoint follows two generations, each of which shifts the poses by 0.01."""
    folder, creature, grid = finished
    for speed in grid.speeds:
        straight, left = (poses_of(folder, Cell(speed, turn), creature) for turn in (0.0, 10.0))
        np.testing.assert_allclose(left, straight + 0.02, atol=1e-6)


def test_an_interrupted_repertoire_resumes_to_the_same_walks(finished, tmp_path: Path):
    """Interrupted after the first generation of the turning walks."""
    folder, creature, grid = finished
    again, _, _ = begin(tmp_path / "again")
    assert not run(again, creature, grid, Interrupted)
    assert stored_generations(again / Cell(0.2, 10.0).name)[-1] == 1
    assert run(again, creature, grid)
    for cell in grid.cells:
        np.testing.assert_array_equal(
            poses_of(folder, cell, creature), poses_of(again, cell, creature)
        )


@pytest.fixture(scope="module")
def examined(finished) -> Path:
    """The folder as if two walks had passed certification."""
    folder, creature, grid = finished
    examine(folder, creature, grid)
    return folder


def test_certified_walks_become_clips_with_table_entries(
    examined: Path, capsys: pytest.CaptureFixture
):
    folder = examined
    said = said_by(capsys, "repertoire", "--resume", folder, "--no-blends", code=0)
    assert "2 of 6 walks are certified" in said
    table = json.loads((folder / "repertoire.json").read_text())
    names = [cell.name for cell in CERTIFIED]
    document = gltf.GLTF2.load_from_bytes((folder / table["file"]).read_bytes())
    ways = [f"{names[0]}_start", f"{names[0]}_stop"]
    clips = ["idle", *(f"{name}-loop" for name in names)]
    assert [animation.name for animation in document.animations] == [*clips, *ways]
    assert [clip["animation"] for clip in table["clips"]] == clips
    assert [(way["from"], way["to"]) for way in table["transitions"]] == [
        ("idle", names[0]),
        (names[0], "idle"),
    ]
    assert "2 of 2 found" in said
    idle, straight, turning = table["clips"]
    assert (idle["speed"], idle["turn"], idle["certified"]) == (0, 0, False)
    assert straight["asked"] == {"speed": 0.2, "turn": 0.0}
    assert (straight["turn"], turning["turn"]) == (0.0, pytest.approx(10.0, rel=0.02))
    assert turning["duration"] == pytest.approx(0.5, abs=1 / 60)
    assert turning["duty_factor"] == pytest.approx(0.6)
    assert {fall["foot"] for fall in turning["contacts"]} <= {n.name for n in document.nodes}
    assert [place["fails"] for place in table["not_certified"]] == [["progress"]] * 4
    assert (folder / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_a_character_that_the_creature_was_not_made_of_is_refused(
    examined: Path, tmp_path: Path, capsys: pytest.CaptureFixture
):
    (tmp_path / "dog.glb").write_bytes(glb())
    before = {file: file.read_bytes() for file in examined.glob("*.*")}
    given = ["repertoire", "--resume", examined, "--onto", tmp_path / "dog.glb"]
    said = said_by(capsys, *given, code=2)
    assert "was not made of a character's skeleton" in said
    assert {file: file.read_bytes() for file in examined.glob("*.*")} == before


def test_half_way_is_the_mean_of_two_controllers(stool: Creature):
    one = dataclasses.replace(treading(stool), wish={"speed": 0.2, "steer": 10.0})
    cycle = np.concatenate([one.genome["key_poses"], mirrored(one.genome["key_poses"], stool)])
    other = dataclasses.replace(
        one,
        genome={"key_poses": cycle + 0.2, "tuning": one.genome["tuning"] + 1.0},
        settings=dataclasses.replace(
            one.settings, mirror=False, key_poses=4, interpolation=one.settings.interpolation + 4
        ),
        wish={"speed": 0.4, "turn": 10.0},
    )
    between = half_way(one, other, stool)
    np.testing.assert_allclose(between.genome["key_poses"], cycle + 0.1)
    np.testing.assert_allclose(between.genome["tuning"], one.genome["tuning"] + 0.5)
    assert between.settings.interpolation == one.settings.interpolation + 2
    assert (between.settings.mirror, between.settings.key_poses) == (False, 4)
    assert between.wish == {"speed": pytest.approx(0.3), "turn": 5.0}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--env", "luxo"], "a repertoire is of walks by key poses"),
        (["--env", STOOL, "--speeds", "fast"], "--speed fast: give m/s"),
        (["--env", STOOL, "--speeds", "0.5", "--turns", "-5"], "each is for both sides"),
        (["--resume", STOOL], "not the folder of a repertoire"),
    ],
)
def test_bad_input_gets_one_sentence(given, said: str, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    heard = said_by(capsys, "repertoire", *given, code=2)
    assert said in heard
    assert not list(tmp_path.iterdir())


def test_a_resumed_repertoire_keeps_its_walks(finished, capsys: pytest.CaptureFixture):
    said = said_by(capsys, "repertoire", "--resume", finished[0], "--turns", "30", code=2)
    assert "keeps its walks and their settings" in said


def test_nothing_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
):
    # If the folder is accepted, fail here and not after 25 walks.
    monkeypatch.setattr(command, "begin", lambda plan: pytest.fail("the folder was accepted"))
    (tmp_path / "mine.txt").write_text("mine")
    said = said_by(capsys, "repertoire", "--env", STOOL, "--out", tmp_path, code=2)
    assert "holds something already" in said
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
