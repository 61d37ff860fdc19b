"""A creature folder is checked on loading: every Creature object can be simulated."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers import STOOL

from mjxgait.creature import Creature, load_creature
from mjxgait.creature.geometry import mirror_map, support_extents
from mjxgait.errors import UserError

SIDES = ("left", "right")


INERTIAL = '<inertial pos="0 0 0" mass="{}" diaginertia="1 1 1"/><freejoint'


def edited(tmp_path: Path, file: str, old: str, new: str) -> Path:
    folder = tmp_path / "stool"
    shutil.copytree(STOOL, folder)
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    return folder


def test_shipped_creatures_are_plausible_animals(shipped: Creature):
    assert 0.1 < shipped.frame.hip_height < 1.0
    assert 0.1 < shipped.frame.body_length < 2.0
    stands_on_its_trunk = shipped.model.body(shipped.trunk).name in shipped.feet.names
    # Legs under a body are shorter than it; a lamp has none, and is taller than it is long.
    assert (shipped.frame.hip_height < shipped.frame.body_length) is not stands_on_its_trunk
    assert 2 < shipped.frame.mass < 60
    assert (shipped.gains.torque_limit <= 3.0 * shipped.frame.mass).all()
    assert np.degrees(shipped.joints.pose_high - shipped.joints.pose_low).max() <= 100


def test_a_pose_span_is_as_wide_as_the_joint_allows(shipped: Creature):
    """Centred on the creature's own range, shifted where it would leave the joint's range."""
    wide = shipped.spanned(90.0)
    room = shipped.joints.high - shipped.joints.low
    assert np.allclose(wide.joints.pose_high - wide.joints.pose_low, np.minimum(np.pi / 2, room))
    assert (wide.joints.pose_low >= shipped.joints.low - 1e-9).all()
    assert (wide.joints.pose_high <= shipped.joints.high + 1e-9).all()
    free = (wide.joints.pose_low > shipped.joints.low) & (
        wide.joints.pose_high < shipped.joints.high
    )
    middle, own = (c.joints.pose_low + c.joints.pose_high for c in (wide, shipped))
    assert free.any()
    assert np.allclose(middle[free], own[free])


def test_without_a_span_pose_ranges_are_those_of_the_file(shipped: Creature):
    same = shipped.spanned(0.0)
    assert (same.joints.pose_low == shipped.joints.pose_low).all()
    assert (same.joints.pose_high == shipped.joints.pose_high).all()


def test_mirroring_twice_is_the_identity(shipped: Creature):
    pose = np.random.default_rng(0).uniform(-1, 1, len(shipped.joints.names))
    once = shipped.mirror.sign * pose[shipped.mirror.partner]
    assert np.allclose(shipped.mirror.sign * once[shipped.mirror.partner], pose)


def test_mirror_map_agrees_with_the_names(shipped: Creature):
    for name, partner in zip(shipped.joints.names, shipped.mirror.partner, strict=True):
        swapped = re.sub(
            "left|right", lambda side: {"left": "right", "right": "left"}[side.group()], name
        )
        assert shipped.joints.names[partner] == swapped


def test_mirror_signs_of_single_joints():
    """Pitch keeps its sign under reflection; roll and yaw change it, because an axis of rotation is
    a pseudo-vector.
    """
    axes = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1]], float)
    partner, sign = mirror_map(
        np.zeros((3, 3)), axes, np.zeros(3, bool), np.zeros((3, 3)), ["pitch", "roll", "yaw"], 0.01
    )
    assert partner.tolist() == [0, 1, 2]
    assert sign.tolist() == [1, -1, -1]


def test_left_and_right_joints_about_one_axis_are_mirror_partners():
    """Shoulder blades that roll about the middle of the chest differ only in what they carry."""
    chest, ahead = np.zeros((3, 3)), np.tile([1.0, 0, 0], (3, 1))
    blades = np.array([[0.1, 0.08, -0.1], [0.1, -0.08, -0.1], [0.2, 0, 0.1]])
    partner, sign = mirror_map(
        chest, ahead, np.zeros(3, bool), blades, ["scapula_L", "scapula_R", "neck"], 0.01
    )
    assert partner.tolist() == [1, 0, 2]
    assert sign.tolist() == [-1, -1, -1]


def test_the_error_names_a_joint_without_partner():
    with pytest.raises(UserError, match='joint "b" has no mirror partner'):
        mirror_map(
            np.array([[0, 0, 0], [0, 0.5, 0]]),
            np.array([[0, 1.0, 0], [0, 1.0, 0]]),
            np.zeros(2, bool),
            np.zeros((2, 3)),
            ["a", "b"],
            0.01,
        )


def test_pose_ranges_are_around_standing_within_the_joint_ranges(stool: Creature, tmp_path: Path):
    assert np.allclose(stool.joints.pose_low, stool.joints.stand - np.radians(40))
    assert np.allclose(stool.joints.pose_high, stool.joints.stand + np.radians(40))
    wide = load_creature(edited(tmp_path, "creature.toml", "[-40, 40]", "[-40, 80]"))
    assert np.allclose(wide.joints.pose_high, 1.05)


def test_the_mirror_map_can_be_overridden(tmp_path: Path):
    ends = ("front", "hind")
    pairs = [
        f'{{joint="{end}_{side}_hip", partner="{end}_{other}_hip", sign=-1}}'
        for end in ends
        for side, other in (SIDES, SIDES[::-1])
    ]
    folder = edited(
        tmp_path, "creature.toml", "[joints]", f"[mirror]\npairs = [{', '.join(pairs)}]\n\n[joints]"
    )
    assert load_creature(folder).mirror.sign.tolist() == [-1, -1, -1, -1]


def test_names_and_mirror_map_must_not_contradict_each_other(tmp_path: Path):
    pairs = [
        f'{{joint="{end}_{side}_hip", partner="{end}_{side}_hip"}}'
        for end in ("front", "hind")
        for side in SIDES
    ]
    folder = edited(
        tmp_path, "creature.toml", "[joints]", f"[mirror]\npairs = [{', '.join(pairs)}]\n\n[joints]"
    )
    with pytest.raises(UserError, match="by its name"):
        load_creature(folder)


def test_a_capsule_reaches_its_radius_beyond_its_ends():
    r, box, ellipsoid = support_extents(3, np.array([0.1, 0.4, 0.0]))
    assert r == 0.1
    assert box.tolist() == [0, 0, 0.4]
    assert not ellipsoid.any()


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("creature.toml", 'trunk = "trunk"', 'trunk = "trunkk"', 'did you mean "trunk"?'),
        (
            "creature.toml",
            '"front_left_foot", ',
            '"front_foot", ',
            'creature.feet = "front_foot" is not in creature.xml',
        ),
        (
            "creature.toml",
            "kp = 40.0",
            "kpp = 40.0",
            'unknown key "joints.kpp"; did you mean "kp"?',
        ),
        ("creature.toml", "kp = 40.0", "kp = -1", "joints.kp = -1"),
        (
            "creature.toml",
            "kp = 40.0",
            "kp = 40000.0",
            "unstable at a time step of 0.005 s; raise kd to",
        ),
        (
            "creature.toml",
            "range = [-40, 40]",
            "range = [70, 80]",
            "pose range lies outside its range",
        ),
        (
            "creature.toml",
            'trunk = "trunk"',
            'trunk = "trunk"\nforward = [0, 0, 1]',
            "points up or down",
        ),
        (
            "creature.toml",
            "[joints]",
            "[steering]\nbend = { spine = 1.0 }\n\n[joints]",
            'no joint matches "spine"',
        ),
        ("creature.xml", '<key name="stand"', '<key name="sit"', 'no keyframe "stand"'),
        (
            "creature.xml",
            'name="floor"',
            'name="ground"',
            'the floor = "floor" is not in creature.xml',
        ),
        (
            "creature.toml",
            '"front_left_foot", ',
            '"front_left_foot", "front_left_foot", ',
            'names "front_left_foot" twice',
        ),
        ("creature.xml", 'timestep="0.005"', 'timestep="0"', "option.timestep = 0 s"),
        ("creature.xml", 'timestep="0.005"', 'timestep="nan"', "option.timestep = nan s"),
        ("creature.xml", 'timestep="0.005"', 'timestep="-1"', "option.timestep = -1 s"),
        (
            "creature.xml",
            "<freejoint",
            INERTIAL.format("inf"),
            'body "trunk" has a mass of inf',
        ),
        (
            "creature.xml",
            "<freejoint",
            INERTIAL.format("1e30"),
            "give it less than 1e+06",
        ),
        ("creature.xml", "</worldbody>", "</worldbod>", "not a model that MuJoCo can load"),
        ("creature.xml", 'type="capsule"', 'type="capsul"', "not a model that MuJoCo can load"),
    ],
)
def test_a_mistake_is_reported_in_one_sentence(
    tmp_path: Path, file: str, old: str, new: str, words: str
):
    folder = edited(tmp_path, file, old, new)
    with pytest.raises(UserError) as error:
        load_creature(folder)
    assert words in str(error.value)
    assert str(folder) in str(error.value)
    assert "\n" not in str(error.value)


def test_the_digest_follows_the_body_only(tmp_path: Path):
    assert (
        load_creature(STOOL).digest
        != load_creature(edited(tmp_path, "creature.xml", "0.04", "0.05")).digest
    )
