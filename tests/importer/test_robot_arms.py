"""Arms of a figure on two legs in a model file: they hang, and swing with the opposite leg."""

import mujoco
import numpy as np
import pytest
from importer.models import bring

from mjxgait.creature import Creature
from mjxgait.importer import stance
from mjxgait.importer.arms import ratios

STRAIGHT = """
        <joint name="{n}_shoulder_pitch" axis="0 1 0" range="-90 90"/>
        <geom type="capsule" fromto="0 0 0 0 {o}0.04 0" size="0.03"/>
        <body name="{n}_upper" pos="0 {o}0.05 0">
          <joint name="{n}_shoulder_roll" axis="1 0 0" range="-100 100"/>
          {rest}
        </body>"""
"""A shoulder that swings about the lateral axis, and lifts below."""
SLANTED = """
        <joint name="{n}_one" axis="2 -{o}1 1" range="-85 85"/>
        <joint name="{n}_two" axis="0 {o}1 1" range="-85 85"/>
        {rest}"""
"""Two hinges of one body; only both together swing the arm ahead."""
REST = """<geom type="capsule" fromto="0 0 0 {upper}" size="0.025"/>
        <body name="{n}_forearm" pos="{upper}">
          <joint name="{n}_elbow" axis="0 0 1" range="{elbow}"/>
          <geom type="capsule" fromto="0 0 0 {fore}" size="0.02"/>
        </body>"""
AHEAD = {STRAIGHT: 0.0, SLANTED: 1.0}
"""How far ahead and down the arms point, over how far outwards."""
LEG = """
      <body name="{n}_thigh" pos="0 {o}0.09 0">
        <joint name="{n}_spread" axis="1 0 0" range="-30 30"/>
        <joint name="{n}_yaw" axis="0 0 1" range="-30 30"/>
        <joint name="{n}_hip" axis="0 1 0" range="-80 80"/>
        <geom type="capsule" fromto="0 0 -0.03 0 0 -0.36" size="0.05"/>
        <body name="{n}_shin" pos="0 0 -0.4">
          <joint name="{n}_knee" axis="0 1 0" range="0 100"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.34" size="0.035"/>
          <body name="{n}_foot" pos="0 0 -0.38">
            <joint name="{n}_ankle" axis="0 1 0" range="-40 40"/>
            <joint name="{n}_tilt" axis="1 0 0" range="-20 20"/>
            <geom type="box" pos="0.03 0 -0.02" size="0.11 0.045 0.02"/>
          </body>
        </body>
      </body>"""
SIDES = {"left": "", "right": "-"}


def figure(shoulder: str = STRAIGHT, arms: str = "left right", legs: str = LEG) -> str:
    """A figure with its arms spread."""
    parts = []
    for n, o in SIDES.items():
        own = {"n": n, "o": o, "elbow": "0 120" if n == "left" else "-120 0"}
        for part, length in (("upper", 0.24), ("fore", 0.2)):
            far = AHEAD[shoulder]
            out = length / np.sqrt(1 + 2 * far**2)
            own[part] = f"{far * out} {o}{out} {-far * out}"
        body = shoulder.format(rest=REST.format(**own), **own).replace("--", "")
        if n in arms:
            parts.append(f'<body name="{n}_shoulder" pos="0 {o}0.16 0.5">{body}</body>')
        parts.append(legs.format(**own))
    return f"""<mujoco><compiler angle="degree"/><worldbody>
    <body name="pelvis" pos="0 0 0.82"><freejoint/>
      <geom type="box" size="0.08 0.1 0.06"/>
      <body name="chest" pos="0 0 0.1">
        <joint name="waist" axis="0 0 1" range="-40 40"/>
        <geom type="box" pos="0 0 0.22" size="0.08 0.11 0.2"/>
        {"".join(part for part in parts if "shoulder" in part).replace("0.5", "0.38")}
      </body>
      {"".join(part for part in parts if "thigh" in part)}
    </body></worldbody></mujoco>"""


def standing(creature: Creature, **angles: float) -> mujoco.MjData:
    """The standing pose, with some joints turned by so many rad."""
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    for name, angle in angles.items():
        data.joint(name).qpos += angle
    mujoco.mj_forward(creature.model, data)
    return data


def swings(creature: Creature) -> dict[str, tuple[str, float]]:
    names = creature.joints.names
    return {names[arm]: (names[leg], share) for arm, leg, share in creature.joints.swings}


@pytest.mark.parametrize("shoulder", [STRAIGHT, SLANTED])
def test_spread_arms_hang_beside_the_body_and_bend_a_little(tmp_path, shoulder):
    creature, imported = bring(tmp_path, figure(shoulder))
    data = standing(creature)
    assert "arms from left_shoulder, right_shoulder on = hang" in imported.notes.text()
    for side, sign in (("left", 1), ("right", -1)):
        elbow, hand = data.body(f"{side}_forearm").xpos, data.body(f"{side}_forearm").xipos
        shoulder_at = data.body(f"{side}_shoulder").xpos
        assert shoulder_at[2] - elbow[2] > 0.2
        assert elbow[2] - hand[2] > 0.05
        assert 0.12 < sign * hand[1] < 0.35


def test_each_arm_swings_with_the_leg_of_the_other_side(tmp_path):
    creature, _ = bring(tmp_path, figure())
    found = swings(creature)
    assert found == {
        "left_shoulder_pitch": ("right_hip", pytest.approx(0.6, abs=0.05)),
        "right_shoulder_pitch": ("left_hip", pytest.approx(0.6, abs=0.05)),
    }
    assert not {"waist", "left_elbow"} & set(creature.joints.names)


@pytest.mark.parametrize("shoulder", [STRAIGHT, SLANTED])
def test_hinges_of_a_shoulder_together_move_the_arm_ahead_with_the_leg(tmp_path, shoulder):
    creature, _ = bring(tmp_path, figure(shoulder))
    legs = {leg for leg, _ in swings(creature).values()}
    assert legs == {"left_hip", "right_hip"}
    for leg in legs:
        turned = {arm: share * -0.3 for arm, (own, share) in swings(creature).items() if own == leg}
        before, after = standing(creature), standing(creature, **turned, **{leg: -0.3})
        arm, other = ("right", "left") if leg == "left_hip" else ("left", "right")
        foot = after.body(f"{other}_foot").xpos - before.body(f"{other}_foot").xpos
        hand = after.body(f"{arm}_forearm").xipos - before.body(f"{arm}_forearm").xipos
        assert foot[0] > 0.1
        assert hand[0] > 0.04
        assert abs(hand[1]) < 0.35 * hand[0]


@pytest.mark.parametrize("shoulder", [STRAIGHT, SLANTED])
def test_a_figure_stands_upright_on_knees_that_bend_a_little(tmp_path, shoulder, monkeypatch):
    """Straight knees have half of the poses near them out of range; bent ones look like a crouch.

    Hardly any pose is drawn at random, so this does not depend on luck.
    """
    monkeypatch.setattr(stance, "FIRST", 2)
    monkeypatch.setattr(stance, "SAMPLES", 2)
    creature, _ = bring(tmp_path, figure(shoulder))
    data = standing(creature)
    for side in SIDES:
        assert 15 < np.degrees(data.joint(f"{side}_knee").qpos[0]) < 35
        assert data.body(f"{side}_foot").xmat[8] > 0.98
    assert data.body("chest").xmat[8] > 0.98


def test_a_keyframe_does_not_move_the_arms(tmp_path):
    hips = {f"{n}_{part}": angle for n in SIDES for part, angle in (("hip", -0.3), ("knee", 0.6))}
    spread = figure(SLANTED)
    data = mujoco.MjData(mujoco.MjModel.from_xml_string(spread))
    for name, angle in (hips | {"left_ankle": -0.3, "right_ankle": -0.3}).items():
        data.joint(name).qpos = angle
    key = f'<keyframe><key name="home" qpos="{" ".join(map(str, data.qpos))}"/></keyframe>'
    creature, imported = bring(tmp_path, spread.replace("</mujoco>", key + "</mujoco>"))
    assert 'the keyframe "home"' in imported.notes.text()
    own = standing(creature)
    assert own.body("left_shoulder").xpos[2] - own.body("left_forearm").xpos[2] > 0.2


def test_the_mirror_image_of_an_arm_is_the_other_arm(tmp_path):
    creature, _ = bring(tmp_path, figure(SLANTED))
    assert creature.mirror.symmetric
    data = standing(creature)
    left, right = (data.body(f"{side}_forearm").xipos for side in SIDES)
    np.testing.assert_allclose(left * [1, -1, 1], right, atol=0.02)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (figure(arms="left"), "one arm"),
        (figure(arms=""), "no arm"),
        (figure(legs=LEG + LEG.replace("_", "_hind_").replace('pos="0 ', 'pos="-0.5 ')), "four"),
    ],
)
def test_other_bodies_have_no_arms_that_swing(tmp_path, text, why):
    creature, imported = bring(tmp_path, text)
    assert not creature.joints.swings, why
    assert "arms from" not in imported.notes.text()


def test_frozen_shoulders_hang_and_do_not_swing(tmp_path):
    creature, imported = bring(tmp_path, figure(), freeze=("*shoulder_pitch", "*elbow"))
    assert not creature.joints.swings
    assert "arms from" in imported.notes.text()
    data = standing(creature)
    assert data.body("left_shoulder").xpos[2] - data.body("left_forearm").xpos[2] > 0.15


def test_turns_about_an_arm_count_for_nothing():
    down, side = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])
    turns, missed = ratios(np.array([[0.0, 1.0, 1.0]]) / np.sqrt(2), down, side)
    assert turns == pytest.approx([np.sqrt(2)])
    assert missed == pytest.approx(0, abs=1e-9)
    turns, missed = ratios(np.array([[1.0, 0.0, 0.0]]), down, side)
    assert missed == pytest.approx(1)
