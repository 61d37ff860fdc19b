"""A walk as numbers for a robot, and two programs that play it."""

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import said_by

from mjxgait.animation.export.motion import BASE, export_motion, motion
from mjxgait.rendering.walk import Walk, record_walk
from mjxgait.training.folder import open_champion

ROOT = Path(__file__).parents[2]
RUN = ROOT / "docs" / "data" / "walk"
"""A stored walk of the tall quadruped."""
COMPILER = shutil.which("cc")


@pytest.fixture(scope="module")
def walk() -> Walk:
    return record_walk(*open_champion(RUN), 4.0)


@pytest.fixture(scope="module")
def exported(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("motion")
    for kind in ("csv", "json"):
        export_motion(walk, folder / f"motion.{kind}")
    return folder


def test_the_command_writes_the_whole_walk(tmp_path: Path, capsys):
    said = said_by(capsys, "export", RUN, "--out", tmp_path / "motion.csv", code=0)
    assert "4.00 s at 200 Hz" in said
    assert len((tmp_path / "motion.csv").read_text().splitlines()) == 801


def test_columns_are_those_of_the_recording(walk: Walk):
    columns = motion(walk)
    names, feet = walk.creature.joints.names, walk.creature.feet.names
    assert len(columns) == 1 + len(BASE) + 4 * len(names) + len(feet)
    assert {len(values) for values in columns.values()} == {len(walk.qpos)}
    np.testing.assert_array_equal(columns["base_x"], walk.qpos[:, 0])
    np.testing.assert_array_equal(columns[f"{names[2]}_vel"], walk.recording.joint_vel[:, 2])
    target, pos, torque = (columns[f"{names[1]}_{what}"] for what in ("target", "pos", "torque"))
    assert 0.005 < np.abs(target - pos).mean() < 0.3
    assert np.corrcoef(target - pos, torque)[0, 1] > 0.5
    contact = np.stack([columns[f"{name}_contact"] for name in feet], 1)
    assert set(np.unique(contact)) == {0, 1}
    assert 1 < contact.sum(1).mean() < 4


def test_both_files_hold_the_same(exported: Path, walk: Walk):
    document = json.loads((exported / "motion.json").read_text())
    with (exported / "motion.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(document["columns"]) == list(rows[0])
    for name, values in document["columns"].items():
        table = np.array([float(row[name]) for row in rows])
        np.testing.assert_allclose(table, values, rtol=1e-4, atol=1e-5, err_msg=name)
    np.testing.assert_allclose(document["kp"], walk.creature.gains.kp)
    first, last = document["loop"]
    angles = np.stack([document["columns"][f"{name}_pos"] for name in document["joints"]], 1)
    apart, half = angles[last] - angles[first], angles[(first + last) // 2] - angles[first]
    assert np.sqrt((apart**2).mean()) < 0.25 * np.sqrt((half**2).mean()), "a loop closes"


def test_pd_control_of_the_targets_walks_on(exported: Path):
    """Open loop: the trunk stays near the recording for three seconds, and moves as far."""
    given = [str(exported / "motion.json"), str(RUN / "creature" / "creature.xml")]
    script = [sys.executable, str(ROOT / "scripts" / "play_motion.py"), *given, "--seconds", "3"]
    said = subprocess.run(script, check=True, capture_output=True, text=True).stdout
    way, off = float(said.split()[0]), float(said.split()[5])
    assert way > 2.5
    assert off < 0.5


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_the_player_in_c_sends_every_target(exported: Path, walk: Walk, tmp_path: Path):
    player = tmp_path / "play"
    source = ROOT / "scripts" / "play_motion.c"
    subprocess.run([COMPILER, "-O1", "-Wall", "-Werror", source, "-o", player], check=True)
    command = [player, exported / "motion.csv", "fast"]
    sent = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    document = json.loads((exported / "motion.json").read_text())
    names = document["joints"]
    assert len(sent) == len(names) * len(document["columns"]["time"])
    time, name, target = sent[len(names) * 100].split()
    assert (float(time), name) == (pytest.approx(0.5), f"{names[0]}_target")
    wanted = document["columns"][f"{names[0]}_target"][100]
    assert float(target) == pytest.approx(wanted, abs=2e-5)


def test_an_unknown_ending_is_refused(capsys, tmp_path: Path):
    said = said_by(capsys, "export", RUN, "--out", tmp_path / "walk.xyz", code=2)
    assert "end the name with .glb, .fbx, .bvh, .usda, .usdc, .csv, .json" in said
