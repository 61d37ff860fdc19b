"""An animator's cycle is read as it was drawn: names, angles, cycle, key poses."""

import dataclasses
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pygltflib as gltf
import pytest
from animation.keys.made import PERIOD, RATE, bvh, columns, poses, swings, write
from helpers import STOOL
from rendering.made_up import treading
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import NOTE
from mjxgait.animation.clips.read_glb import _turn
from mjxgait.animation.clips.read_text import read_csv
from mjxgait.animation.export import WalkLoop, build_glb
from mjxgait.animation.keys import bring
from mjxgait.animation.keys.bring import Brought
from mjxgait.animation.keys.cycle import find_cycle, fit_poses
from mjxgait.animation.keys.retarget import matched
from mjxgait.config.layers import find_creature
from mjxgait.controllers.key_poses.config import TUNING
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.rendering.walk import Walk

LOOSE = np.radians(90.0)
"""Tolerance of tests that are not about key poses."""


def worst(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest difference, degrees."""
    return float(np.degrees(np.abs(found - wanted).max()))


def test_an_exported_cycle_is_read_back_with_the_same_angles(shipped: Creature, tmp_path: Path):
    angles = swings(shipped, mirrored=True)
    file = write(tmp_path, "glb", shipped, angles[::4])
    brought = bring(shipped, file, tolerance=LOOSE)
    assert worst(brought.track.angles, angles[::4]) < 0.5
    assert set(brought.track.errors) == set(shipped.joints.names)
    assert all(np.degrees(missed.max()) < 0.1 for missed in brought.track.errors.values())


@pytest.mark.parametrize("kind", ["glb", "bvh", "csv", "json"])
def test_every_kind_of_file_gives_the_same_cycle(stool: Creature, tmp_path: Path, kind: str):
    angles = swings(stool, cycles=2)
    brought = bring(stool, write(tmp_path, kind, stool, angles), tolerance=LOOSE)
    assert worst(brought.track.angles, angles) < 0.05
    assert brought.cycle.period == pytest.approx(PERIOD, abs=1 / RATE)


@pytest.mark.parametrize("order", ["XYZ", "YZX", "ZYX"])
def test_angles_of_a_bvh_file_are_in_the_order_that_it_names(tmp_path, order):
    """A duck's hips and ankles turn about several axes in series."""
    duck = load_creature(find_creature("duck"))
    angles = swings(duck)[::6]
    file = tmp_path / "walk.bvh"
    file.write_text(bvh(duck, angles, order))
    assert worst(bring(duck, file, tolerance=LOOSE).track.angles, angles) < 0.05


def test_a_column_name_can_state_degrees(stool: Creature, tmp_path: Path):
    angles = swings(stool)
    file = tmp_path / "walk.csv"
    file.write_text(columns(stool, angles, degrees=True))
    assert worst(bring(stool, file, tolerance=LOOSE).track.angles, angles) < 0.01


def test_a_bone_turned_in_the_file_turns_the_joint_equally(stool: Creature, tmp_path: Path):
    """One leg is ten degrees further forward in all frames."""
    angles = swings(stool)
    angles[:, 1] += np.radians(10.0)
    before = bring(stool, write(tmp_path, "glb", stool, swings(stool)), tolerance=LOOSE)
    after = bring(stool, write(tmp_path, "glb", stool, angles), tolerance=LOOSE)
    change = np.degrees(after.track.angles - before.track.angles)
    assert change[:, 1] == pytest.approx(10.0, abs=0.1)
    assert np.delete(change, 1, axis=1) == pytest.approx(0.0, abs=0.1)


def test_joints_with_an_offset_zero_are_read_back(stool: Creature, tmp_path: Path):
    """MuJoCo's `ref`: the joint angle of the pose in the file."""
    folder = shutil.copytree(STOOL, tmp_path / "offset")
    xml = (folder / "creature.xml").read_text()
    xml = xml.replace('name="front_left_hip"', 'name="front_left_hip" ref="0.3"')
    (folder / "creature.xml").write_text(xml.replace("1 0 0 0 0 0 0 0", "1 0 0 0 0.3 0 0 0"))
    offset = load_creature(folder)
    angles = swings(offset)[::4]
    brought = bring(offset, write(tmp_path, "bvh", offset, angles), tolerance=LOOSE)
    assert worst(brought.track.angles, angles) < 0.05


def test_angles_beyond_a_joint_range_are_reported(stool: Creature, tmp_path: Path):
    angles = np.tile(stool.joints.stand, (20, 1))
    beyond = np.degrees(stool.joints.high[0]) + 30.0
    angles[10:, 0] = np.radians(beyond)
    brought = bring(stool, write(tmp_path, "bvh", stool, angles), tolerance=LOOSE)
    missed = np.degrees(brought.track.errors[stool.joints.names[0]])
    assert missed.max() == pytest.approx(30.0, abs=0.5)
    assert missed.min() == pytest.approx(0.0, abs=0.1)
    assert brought.track.angles.max() <= stool.joints.high.max() + 1e-6


@pytest.mark.parametrize(
    ("own", "theirs"),
    [
        ("left_shin", "mixamorig:LeftLeg.lower"),
        ("front_left_thigh", "thigh.front.L"),
        ("hind_right_upper", "rear_upper_leg_R"),
        ("left_foot", "LeftToe"),
        ("right_thigh", "RightUpLeg"),
    ],
)
def test_names_that_mean_the_same_are_matched(own: str, theirs: str):
    other = theirs.replace("L", "R") if "L" in theirs else "tail"
    assert matched([own], ["Spine", "Armature", theirs, other], None, "") == {own: theirs}


def test_left_is_never_taken_for_right():
    assert matched(["left_foot"], ["right_foot"], None, "") == {}


def test_a_name_table_overrides_similarity():
    assert matched(["a_left"], ["a_left", "x"], {"a_left": "x"}, "") == {"a_left": "x"}
    with pytest.raises(UserError, match='"y" is not there'):
        matched(["a_left"], ["a_left", "x"], {"a_left": "y"}, "names.toml")


@pytest.mark.parametrize("cycles", [1, 2, 3, 2.6])
def test_the_period_is_found(stool: Creature, cycles: float):
    angles = swings(stool, cycles)
    cycle = find_cycle(stool, np.arange(len(angles)) / RATE, angles)
    assert cycle.period == pytest.approx(PERIOD, rel=0.02)


def test_the_user_can_give_the_limits_of_a_cycle(stool: Creature):
    angles = swings(stool, cycles=2)
    cycle = find_cycle(stool, np.arange(len(angles)) / RATE, angles, 0.2, 0.2 + PERIOD)
    assert (cycle.begins, cycle.period) == (pytest.approx(0.2), pytest.approx(PERIOD))
    with pytest.raises(UserError, match=r"the file has 0 to 1\.6 s"):
        find_cycle(stool, np.arange(len(angles)) / RATE, angles, 0.2, 9.0)


@pytest.mark.parametrize("mirrored", [True, False])
def test_a_mirrored_cycle_is_recognized(shipped: Creature, mirrored: bool):
    angles = swings(shipped, mirrored=mirrored)
    cycle = find_cycle(shipped, np.arange(len(angles)) / RATE, angles)
    moves = any(j != p for j, p in enumerate(shipped.mirror.partner))
    if moves and shipped.mirror.symmetric:
        middle = len(cycle.angles) // 2
        lack = worst(shipped.mirror.image(cycle.angles[:middle]), cycle.angles[middle:])
        assert (lack < 1e-6) == cycle.mirrored
    if not mirrored:
        assert not cycle.mirrored


def test_fitting_a_cycle_of_key_poses_gives_exactly_these_poses(stool: Creature):
    drawn = swings(stool, 1.0)[[0, 5, 11, 19]]
    samples = 120
    at = np.arange(samples) / samples * len(drawn)
    closed = np.concatenate([drawn, drawn[:1]])
    angles = np.stack([np.interp(at, range(len(closed)), column) for column in closed.T], 1)
    cycle = find_cycle(stool, np.arange(samples + 1) / samples, np.append(angles, angles[:1], 0))
    fit = fit_poses(stool, cycle, np.radians(0.1))
    assert worst(fit.key_poses, drawn) < 0.1


def test_a_finer_tolerance_is_met_with_more_key_poses(shipped: Creature):
    angles = swings(shipped, mirrored=True)
    cycle = find_cycle(shipped, np.arange(len(angles)) / RATE, angles)
    rough, fine = (fit_poses(shipped, cycle, np.radians(d)) for d in (8.0, 2.0))
    assert len(fine.key_poses) >= len(rough.key_poses)
    assert fine.error <= np.radians(2.0)


def test_a_long_file_needs_the_limits_of_the_cycle(stool: Creature, tmp_path: Path):
    angles = swings(stool, cycles=70)
    file = write(tmp_path, "csv", stool, angles)
    with pytest.raises(UserError, match="--from and --to"):
        bring(stool, file)
    brought = bring(stool, file, ends=(10 * PERIOD, 11 * PERIOD), tolerance=LOOSE)
    assert (brought.cycle.begins, brought.cycle.period) == pytest.approx((10 * PERIOD, PERIOD))


@pytest.fixture
def exported(stool: Creature) -> WalkLoop:
    """A walk with joints that follow their targets late and incompletely."""
    walk = Walk(stool, treading(stool, degrees=12.0), None, np.inf)
    qpos = poses(stool, swings(stool))
    return WalkLoop(walk, qpos, RATE, 1, 0.0, 1.0, (0, len(qpos) - 1))


def test_an_exported_walk_is_read_back_with_its_own_key_poses(exported, tmp_path):
    creature, champion = exported.walk.creature, exported.walk.champion
    (tmp_path / "walk.glb").write_bytes(build_glb(exported))
    own = bring(creature, tmp_path / "walk.glb", tolerance=LOOSE).own
    assert own
    assert np.degrees(own.changed) < 0.1
    assert worst(own.fit.key_poses, champion.genome["key_poses"]) < 0.01
    assert own.tuning == pytest.approx(dict(zip(TUNING, champion.genome["tuning"], strict=True)))


@pytest.mark.parametrize("degrees", [2.0, 10.0])
def test_a_joint_bent_in_the_file_is_bent_in_the_key_poses(exported, tmp_path, degrees):
    """One hip in all frames; also by so little that both sides look alike."""
    creature, champion = exported.walk.creature, exported.walk.champion
    brought = edited(exported, {1: degrees}, tmp_path)
    own = brought.own
    assert own
    assert not brought.cycle.mirrored
    half = champion.genome["key_poses"]
    moved = np.degrees(own.fit.key_poses - np.concatenate([half, creature.mirror.image(half)]))
    assert moved[:, 1] == pytest.approx(degrees, abs=0.5)
    assert np.delete(moved, 1, axis=1) == pytest.approx(0.0, abs=0.5)


def test_joints_bent_on_both_sides_stay_mirrored(exported, tmp_path):
    creature, champion = exported.walk.creature, exported.walk.champion
    bends = {1: 8.0, int(creature.mirror.partner[1]): 8.0 * creature.mirror.sign[1]}
    brought = edited(exported, bends, tmp_path)
    assert brought.own
    assert brought.cycle.mirrored
    moved = np.degrees(brought.own.fit.key_poses - champion.genome["key_poses"])
    assert moved == pytest.approx(
        np.tile([bends.get(j, 0.0) for j in range(moved.shape[1])], (len(moved), 1)), abs=0.5
    )


def edited(exported: WalkLoop, bends: dict[int, float], folder: Path) -> Brought:
    """Read an exported walk with joints bent by these degrees in the file."""
    creature, bent = exported.walk.creature, exported.qpos.copy()
    for joint, degrees in bends.items():
        bent[:, creature.joints.qpos[joint]] += np.radians(degrees)
    document = gltf.GLTF2.load_from_bytes(build_glb(exported))
    other = gltf.GLTF2.load_from_bytes(build_glb(dataclasses.replace(exported, qpos=bent)))
    other.nodes[0].extras = document.nodes[0].extras
    (folder / "walk.glb").write_bytes(b"".join(other.save_to_bytes()))
    return bring(creature, folder / "walk.glb", tolerance=LOOSE)


def test_a_walk_of_another_creature_is_read_as_a_plain_cycle(stool, exported, tmp_path):
    document = gltf.GLTF2.load_from_bytes(build_glb(exported))
    note = json.loads(document.nodes[0].extras[NOTE])
    for changed in (note | {"creature": "other"}, note | {"motion": {}}, []):
        document.nodes[0].extras = {NOTE: json.dumps(changed)}
        (tmp_path / "walk.glb").write_bytes(b"".join(document.save_to_bytes()))
        assert bring(stool, tmp_path / "walk.glb", tolerance=LOOSE).own is None


@pytest.mark.parametrize("ends", [(1.5, 0.5), (5.0, None), (None, 9.0)])
def test_seconds_that_a_file_does_not_have_are_refused(
    ends: tuple[float | None, float | None], stool: Creature, tmp_path: Path
):
    file = write(tmp_path, "csv", stool, swings(stool))
    with pytest.raises(UserError, match=r"--from .* the file has 0 to"):
        bring(stool, file, None, ends)


def test_a_quotation_mark_that_never_ends_is_one_sentence(tmp_path: Path):
    file = tmp_path / "walk.csv"
    file.write_text('time,"a\n' + "0,0\n" * 60_000)
    with pytest.raises(UserError, match="field larger than field limit"):
        read_csv(file)


def test_a_mirrored_node_is_turned_as_its_mirror_image():
    turned = Rotation.from_euler("y", 30, degrees=True)
    mirrored = turned.as_matrix() * [-1.0, 1.0, 1.0]
    whole = np.eye(4)
    whole[:3, :3] = 2 * mirrored
    for node in (
        SimpleNamespace(matrix=None, rotation=turned.as_quat().tolist(), scale=[-2, 2, 2]),
        SimpleNamespace(matrix=whole.T.ravel().tolist()),
    ):
        assert _turn(node) == pytest.approx(turned.as_matrix())
