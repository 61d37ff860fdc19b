"""Every fact that decides about a certificate is derived twice: each planted error is caught."""

import numpy as np
import pytest
from certify_made_up import make_champion
from helpers import altered

from mjxgait.certify import glance
from mjxgait.certify.check_body import check_body
from mjxgait.creature import load_creature
from mjxgait.errors import UserError
from mjxgait.runs.folder import create_run
from mjxgait.settings.config import Config


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


def test_nothing_is_examined_on_wrong_facts(tiny):
    with pytest.raises(UserError, match="hip height"):
        glance(altered(tiny, frame={"hip_height": 0.1}), make_champion(tiny))


def test_the_shipped_creatures_are_what_their_files_say(shipped):
    check_body(shipped)


def test_masses_may_lie_otherwise_on_one_side(tiny, tmp_path):
    """As in files that say where the middle of a part is as if all legs were left ones; nothing of how
    joints mirror each other follows from it.
    """
    text, leg = tiny.files["creature.xml"], '<body name="front_left_upper"'
    assert text.count(leg) == 1
    place = text.index(">", text.index(leg)) + 1
    heavy = '<inertial pos="0 0.1 0" mass="0.2" diaginertia="1e-3 1e-3 1e-3"/>'
    (tmp_path / "creature.toml").write_text(tiny.files["creature.toml"])
    (tmp_path / "creature.xml").write_text(text[:place] + heavy + text[place:])
    check_body(load_creature(tmp_path))


def test_a_body_that_cannot_be_examined_is_not_trained(tiny, tmp_path):
    """Told at once instead of after the first generations."""
    wrong = altered(tiny, mirror={"sign": changed(tiny.mirror.sign, 1, -1)})
    with pytest.raises(UserError, match="does not mirror"):
        create_run(tmp_path / "run", wrong, Config())
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
