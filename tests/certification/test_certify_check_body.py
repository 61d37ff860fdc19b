"""Every fact that decides a certificate is derived twice: each planted error is caught."""

import dataclasses

import numpy as np
import pytest
from certify_made_up import make_champion
from helpers import altered, short_examination

from mjxgait.certification import nominal_check
from mjxgait.certification.check_body import check_body
from mjxgait.champion import read_champion, write_champion
from mjxgait.config.schema import Config
from mjxgait.config.tables import build
from mjxgait.creature import load_creature
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.training import folder
from mjxgait.training.folder import create_run


def changed(values, index, value):
    copy = np.array(values)
    copy[index] = value
    return copy


ERRORS = {
    "hip height": lambda c: {"frame": {"hip_height": 1.1 * c.frame.hip_height}},
    "body length": lambda c: {"frame": {"body_length": 0.5 * c.frame.body_length}},
    "mass": lambda c: {"frame": {"mass": c.frame.mass - 0.1}},
    "forward axis": lambda c: {"frame": {"forward": -c.frame.forward}},
    "left axis": lambda c: {"frame": {"left": -c.frame.left}},
    "up axis": lambda c: {"frame": {"up": np.array([0.1, 0.0, 0.995])}},
    "standing pose": lambda c: {"stand_qpos": changed(c.stand_qpos, 9, 0.1)},
    "standing trunk's place": lambda c: {"frame": {"stand_pos": c.frame.stand_pos + 0.05}},
    "standing angles": lambda c: {"joints": {"stand": changed(c.joints.stand, 3, 0.1)}},
    "trunk": lambda c: {"trunk": c.trunk + 1},
    "feet": lambda c: {"feet": {"names": c.feet.names[::-1]}},
    "velocities' places": lambda c: {"joints": {"dofs": c.joints.dofs[::-1]}},
    'kp of joint "front_left_knee"': lambda c: {"gains": {"kp": changed(c.gains.kp, 1, 90.0)}},
    'kd of joint "front_left_hip"': lambda c: {"gains": {"kd": changed(c.gains.kd, 0, 1.0)}},
    'torque_limit of joint "front_right_hip"': lambda c: {
        "gains": {"torque_limit": changed(c.gains.torque_limit, 2, 1e3)}
    },
    'upper limit of joint "front_left_hip"': lambda c: {
        "joints": {"high": changed(c.joints.high, 0, 2)}
    },
    'lowest pose of joint "front_left_hip"': lambda c: {
        "joints": {"pose_low": changed(c.joints.pose_low, 0, -1)}
    },
    'weight \\(stride\\) of joint "front_right_hip"': lambda c: {
        "corrections": {"steer_stride": np.abs(c.corrections.steer_stride)}
    },
    'weight \\(pitch\\) of joint "front_left_hip"': lambda c: {
        "corrections": {"balance_pitch": -c.corrections.balance_pitch}
    },
    'does not mirror "front_left_hip" with sign 1': lambda c: {
        "mirror": {"partners": tuple(range(8))}
    },
    'does not mirror "front_right_knee" with sign -1': lambda c: {
        "mirror": {"sign": changed(c.mirror.sign, 1, -1)}
    },
    'does not mirror "hind_right_hip"': lambda c: {
        "mirror": {"partners": tuple(np.roll(c.mirror.partner, 4))}
    },
}


@pytest.mark.parametrize("thing", ERRORS)
def test_an_error_in_the_shared_loader_is_named(tiny, thing):
    wrong = altered(tiny, **ERRORS[thing](tiny))
    with pytest.raises(UserError, match=thing):
        check_body(wrong)


def test_wrong_facts_prevent_an_examination(tiny):
    with pytest.raises(UserError, match="hip height"):
        nominal_check(altered(tiny, frame={"hip_height": 0.1}), make_champion(tiny))


def test_the_shipped_creatures_match_their_files(shipped):
    check_body(shipped)


def test_masses_may_differ_between_the_sides(tiny, tmp_path):
    """Some files place centres of mass as if all legs were left ones.

    The mirroring of joints does not depend on them.
    """
    text, leg = tiny.files["creature.xml"], '<body name="front_left_upper"'
    assert text.count(leg) == 1
    place = text.index(">", text.index(leg)) + 1
    heavy = '<inertial pos="0 0.1 0" mass="0.2" diaginertia="1e-3 1e-3 1e-3"/>'
    (tmp_path / "creature.toml").write_text(tiny.files["creature.toml"])
    (tmp_path / "creature.xml").write_text(text[:place] + heavy + text[place:])
    check_body(load_creature(tmp_path))


def test_a_body_that_cannot_be_examined_is_not_trained(tiny, tmp_path):
    """The error comes at once, not after the first generations."""
    wrong = altered(tiny, mirror={"sign": changed(tiny.mirror.sign, 1, -1)})
    with pytest.raises(UserError, match="does not mirror"):
        create_run(tmp_path / "run", wrong, Config())
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("degrees", [20.0, 90.0, 300.0])
def test_the_pose_ranges_of_a_span_pass_the_check(shipped, degrees):
    check_body(shipped.spanned(degrees), degrees)


@pytest.mark.parametrize(
    ("has", "stated"), [(0.0, 70.0), (70.0, 0.0), (60.0, 70.0)], ids=["none", "unstated", "other"]
)
def test_a_pose_range_of_another_span_is_named(tiny, has, stated):
    """The range limits the champion's poses, so only the run's own span is valid."""
    with pytest.raises(UserError, match='lowest pose of joint "front_left_hip"'):
        check_body(tiny.spanned(has), stated)


def test_a_champion_has_the_pose_ranges_of_its_run(tiny, tmp_path):
    """This includes a champion read from its file, and its nominal check."""
    champion = dataclasses.replace(make_champion(tiny), pose_span=60.0)
    write_champion(champion, tiny, tmp_path / "champion.json")
    again = read_champion(tmp_path / "champion.json", tiny)
    assert again.fingerprint == champion.fingerprint != make_champion(tiny).fingerprint
    body = again.embodied(tiny)
    assert np.allclose(body.joints.pose_high - body.joints.pose_low, np.radians(60.0))
    assert nominal_check(body, again, short_examination()).whole.trunk_pos.size
    with pytest.raises(UserError, match="lowest pose"):
        nominal_check(tiny, again, short_examination())


def test_a_champion_without_a_span_has_none_in_its_file(tiny, tmp_path):
    write_champion(make_champion(tiny), tiny, tmp_path / "champion.json")
    assert "pose_span" not in (tmp_path / "champion.json").read_text()


def test_the_extreme_sizes_of_a_body_are_checked_before_training(tiny, tmp_path, monkeypatch):
    """The nominal, smallest and largest bodies, each with the run's pose span."""
    seen = []
    monkeypatch.setattr(folder, "check_body", lambda body, span: seen.append((body, span)))
    settings = build(Config, {"evolution": {"body": 1.25, "pose_span": 60.0}}, "test")
    create_run(tmp_path / "run", tiny, settings)
    assert [span for _, span in seen] == [60.0] * 3
    hips = [body.frame.hip_height for body, _ in seen]
    assert hips[1] < hips[0] < hips[2]


def test_impossible_sizes_leave_no_folder(tiny, tmp_path):
    nameless = creature_of(
        {
            **tiny.files,
            "creature.xml": tiny.files["creature.xml"].replace(' name="hind_left_lower"', ""),
        }
    )
    settings = build(Config, {"evolution": {"body": 1.25}}, "test")
    with pytest.raises(UserError, match="has no name"):
        create_run(tmp_path / "run", nameless, settings)
    assert not (tmp_path / "run").exists()


def test_exceptions_and_stated_partners_are_read_from_the_text(tiny, tmp_path):
    toml = (
        tiny.files["creature.toml"]
        + """
[[joint]]
match = "*_knee"
kp = 50.0
range = [-20, 60]

[[joint]]
match = "front_*"
kd = 3.0

[mirror]
pairs = [
    { joint = "front_left_knee", partner = "front_right_knee" },
    { joint = "front_right_knee", partner = "front_left_knee" },
]
"""
    )
    (tmp_path / "creature.toml").write_text(toml)
    (tmp_path / "creature.xml").write_text(tiny.files["creature.xml"])
    creature = load_creature(tmp_path)
    assert (creature.gains.kp[1], creature.gains.kd[1], creature.gains.kd[5]) == (50.0, 3.0, 2.0)
    check_body(creature)
    wrong = altered(creature, mirror={"sign": changed(creature.mirror.sign, 1, -1)})
    with pytest.raises(UserError, match=r"\[mirror\] pairs says front_right_knee with sign 1"):
        check_body(wrong)


def test_a_body_without_symmetry_has_no_mirror_to_check(tiny, tmp_path):
    (tmp_path / "creature.toml").write_text(
        tiny.files["creature.toml"] + "\n[mirror]\nsymmetric = false\n"
    )
    (tmp_path / "creature.xml").write_text(tiny.files["creature.xml"])
    check_body(load_creature(tmp_path))
