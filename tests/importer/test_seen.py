"""What a person sees in a body, an import sees too: its front, its sides, what is no leg."""

import mujoco
import numpy as np
import pytest
from importer.models import BIPED, QUADRUPED, bring

from mjxgait.certification.check_body import check_body
from mjxgait.certification.feasibility import feasibility
from mjxgait.creature import Creature
from mjxgait.importer.orient import _named_front


def front(creature: Creature) -> np.ndarray:
    """Forward axis [3] in the file's world: bodies here are written in their standing pose."""
    return creature.frame.forward


def limb(name: str, at: tuple[float, float], joints: str, end: str = "") -> str:
    """A leg of two capsules straight down; joints: of its thigh."""
    return (
        f'<body name="{name}" pos="{at[0]} {at[1]} 0">{joints}'
        f'<geom type="capsule" fromto="0 0 0 0 0 -.15" size=".02"/>'
        f'<body name="{name}_shin" pos="0 0 -.15">{end}'
        f'<geom type="capsule" fromto="0 0 0 0 0 -.15" size=".02"/></body></body>'
    )


def animal(legs: str, joints: str = "") -> str:
    return (
        '<mujoco><compiler angle="degree"/><worldbody><body name="trunk" pos="0 0 .35"><freejoint/>'
        f'<geom type="box" size=".15 .15 .05"/>{joints}{legs}</body></worldbody></mujoco>'
    )


CORNERS = {"FL": (-0.1, 0.15), "FR": (0.1, 0.15), "BL": (-0.1, -0.15), "BR": (0.1, -0.15)}


@pytest.mark.parametrize(("axis", "forward"), [("1 0 0", [0, 1, 0]), ("0 1 0", [1, 0, 0])])
def test_forward_is_where_the_hinges_swing_the_feet(tmp_path, axis, forward):
    """Both sides are alike along x and along y; legs that swing along y walk along y."""
    legs = "".join(
        limb(
            name,
            at,
            f'<joint name="{name}_hip" axis="{axis}" range="-60 60"/>',
            f'<joint name="{name}_knee" axis="{axis}" range="-70 70"/>',
        )
        for name, at in CORNERS.items()
    )
    creature, imported = bring(tmp_path, animal(legs))
    np.testing.assert_allclose(np.abs(front(creature)), forward, atol=1e-6)
    if axis == "1 0 0":  # and of its two ends the one with FL and FR is the front
        assert front(creature)[1] > 0
    assert "times as far along" in imported.notes.text()


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("FL_hip", 1),
        ("br", -1),
        ("front_leg", 1),
        ("hind", -1),
        ("flesh", 0),
        ("thigh_rl", -1),
        ("lr_knee", 0),  # the right leg of a humanoid with a left one called ll
    ],
)
def test_corners_are_read_as_whole_words(name, side):
    assert _named_front(name) == side


@pytest.mark.usefixtures("a_short_search")
@pytest.mark.parametrize("sides", [("l", "r"), ("Left", "Right")])
def test_names_of_sides_say_the_front_where_the_body_does_not(tmp_path, sides):
    """A six-legged body with legs about upright axes is as good along x as along y."""
    legs = "".join(
        limb(
            f"{name}_{row}",
            (x, -row / 5),
            f'<joint name="{name}_hip_{row}" axis="0 0 1" range="-60 60"/>'
            f'<joint name="{name}_lift_{row}" axis="{row} {5 * x} 0" range="-40 40"/>',
        )
        for row in (-1, 0, 1)
        for name, x in zip(sides, (0.2, -0.2), strict=True)
    )
    creature, imported = bring(tmp_path, animal(legs))
    np.testing.assert_allclose(front(creature), [0, -1, 0], atol=1e-6)
    assert "the names of left and right parts" in imported.notes.text()


def sprawling(name: str, side: int, x: float) -> str:
    """A leg that reaches out to one side: a hinge that swings it, and two that lift and bend it."""
    return (
        f'<body name="{name}" pos="{x} {0.05 * side} 0">'
        f'<joint name="{name}_swing" axis="0 0 1" range="-15 15"/>'
        f'<joint name="{name}_lift" axis="1 0 0" range="-40 40"/>'
        f'<geom type="capsule" fromto="0 0 0 0 {0.2 * side} .02" size=".02"/>'
        f'<body name="{name}_shin" pos="0 {0.2 * side} .02">'
        f'<joint name="{name}_knee" axis="1 0 0" range="-50 50"/>'
        f'<geom type="capsule" fromto="0 0 0 0 {0.05 * side} -.14" size=".015"/></body></body>'
    )


@pytest.mark.usefixtures("a_short_search")
def test_legs_that_sprawl_walk_ahead_and_are_strong_enough_for_their_reach(tmp_path):
    """Lifting and bending swing these feet sideways, three times as far as the third hinge ahead.

    The hinges carry the weight on arms longer than the hip height.
    """
    legs = "".join(
        sprawling(f"{name}_{row}", side, 0.12 * row)
        for row in (-1, 0, 1)
        for name, side in (("left", 1), ("right", -1))
    )
    creature, imported = bring(tmp_path, animal(legs))
    np.testing.assert_allclose(front(creature), [1, 0, 0], atol=1e-6)
    assert "longer arms where legs sprawl" in imported.notes.text()
    assert feasibility(creature).limits == []
    lift = creature.joints.names.index("left_0_lift")
    swing = creature.joints.names.index("left_0_swing")
    assert creature.gains.torque_limit[lift] > 1.5 * creature.gains.torque_limit[swing]


@pytest.mark.usefixtures("a_short_search")
def test_a_hinge_mirrors_another_wherever_its_anchor_lies_on_its_axis(tmp_path):
    """All servos have their frames on their left: the left hinges lie farther out."""
    legs = "".join(
        f'<body name="{name}" pos="0 {y + 0.05} 0"><joint name="{name}_hip" axis="0 1 0" '
        f'range="-60 60"/><geom type="capsule" fromto="0 -.05 0 0 -.05 -.15" size=".02"/>'
        f'<body name="{name}_shin" pos="0 0 -.15"><joint name="{name}_knee" axis="0 1 0" '
        f'range="-70 70"/><geom type="capsule" fromto="0 -.05 0 .1 -.05 -.15" size=".02"/>'
        "</body></body>"
        for name, y in (("left", 0.1), ("right", -0.1))
    )
    creature, _ = bring(tmp_path, animal(legs))
    assert creature.mirror is not None
    assert list(creature.mirror.partner) == [2, 3, 0, 1]
    check_body(creature)


@pytest.mark.usefixtures("a_short_search")
def test_a_leg_without_a_foot_walks_the_way_its_knee_points(tmp_path):
    """The file's knees bend backward from a front along -x, as those of gym's humanoid from x."""
    legs = "".join(
        limb(
            name,
            (0, y),
            f'<joint axis="0 1 0" name="{name}_hip" range="-60 60"/>'
            f'<joint axis="1 0 0" name="{name}_roll" range="-30 30"/>',
            f'<joint axis="0 -1 0" name="{name}_knee" range="10 120"/>',
        )
        for name, y in (("one", 0.1), ("other", -0.1))
    )
    creature, imported = bring(tmp_path, animal(legs))
    assert front(creature)[0] == pytest.approx(-1)
    assert "knees point that way" in imported.notes.text()


@pytest.mark.usefixtures("a_short_search")
def test_an_ankle_without_an_exact_image_is_paired_and_told(tmp_path):
    hinge = BIPED[BIPED.index('<joint name="right_ankle"') :]
    hinge = hinge[: hinge.index("</joint>")]
    askew = BIPED.replace(hinge, hinge.replace('axis xyz="0 1 0"', 'axis xyz="0.5 0.87 0"'))
    creature, imported = bring(tmp_path, askew, "urdf")
    names = creature.joints.names
    left = names.index("left_ankle")
    assert creature.mirror.symmetric
    assert names[creature.mirror.partner[left]] == "right_ankle"
    assert creature.mirror.sign[left] == 1
    assert "left_ankle, right_ankle are paired by their names" in imported.notes.text()
    assert [p.joint for p in creature.settings.mirror.pairs] == ["left_ankle", "right_ankle"]
    check_body(creature)


@pytest.mark.usefixtures("a_short_search")
def test_an_ankle_that_only_one_leg_has_keeps_its_angle_in_both_halves(tmp_path):
    """Half of the cycle is the other's mirror image, but for the ankle."""
    start = BIPED.index('<joint name="right_ankle"')
    welded = BIPED[:start] + BIPED[start:].replace('type="revolute"', 'type="fixed"', 1)
    creature, imported = bring(tmp_path, welded, "urdf")
    left = creature.joints.names.index("left_ankle")
    assert creature.mirror.symmetric
    assert creature.mirror.partner[left] == left
    assert creature.mirror.sign[left] == 1
    assert "left_ankle has no partner" in imported.notes.text()
    check_body(creature)


SEGMENTS = 9


def insect() -> str:
    """Six legs of eleven hinges, a mouth that hangs to the floor, and a head that swings."""
    legs = ""
    for i, x in enumerate((-0.2, 0, 0.2)):
        for side, y in (("left", 0.1), ("right", -0.1)):
            name = f"T{i}_{side}"
            toes = "".join(
                f'<body name="{name}_toe{k}" pos="0 0 -.01"><joint name="{name}_toe{k}" '
                'axis="0 1 0" range="-20 20"/><geom type="sphere" size=".006"/>'
                for k in range(SEGMENTS)
            )
            legs += (
                f'<body name="{name}" pos="{x} {y} 0"><joint name="{name}_hip" axis="0 1 0" '
                'range="-60 60"/><geom type="capsule" fromto="0 0 0 0 0 -.15" size=".02"/>'
                f'<body name="{name}_shin" pos="0 0 -.15"><joint name="{name}_knee" axis="0 1 0" '
                'range="-70 70"/><geom type="capsule" fromto="0 0 0 0 0 -.15" size=".02"/>'
                f'<body name="{name}_foot" pos="0 0 -.15">{toes}{"</body>" * SEGMENTS}'
                "</body></body></body>"
            )
    mouth = (
        '<body name="proboscis" pos=".3 0 0"><joint name="proboscis" axis="0 1 0" range="-40 40"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.35" size=".01"/></body>'
    )
    return animal(legs + mouth)


@pytest.mark.usefixtures("a_short_search")
def test_an_insect_walks_on_its_legs_and_keeps_the_joints_that_swing_them(tmp_path):
    creature, imported = bring(tmp_path, insect())
    assert len(creature.feet.names) == 6
    names = creature.joints.names
    assert "proboscis" not in names
    assert len(names) == 36
    for leg in ("T0_left", "T2_right"):
        assert {f"{leg}_hip", f"{leg}_knee"} <= set(names)
        assert f"{leg}_toe{SEGMENTS - 1}" not in names
    assert "of 66 joints of the legs those that swing a foot least" in imported.notes.text()


@pytest.mark.usefixtures("a_short_search")
def test_a_swing_is_no_wing(tmp_path):
    creature, _ = bring(tmp_path, QUADRUPED.replace("fl_shin", "swing_fl"))
    assert len(creature.feet.names) == 4


def folded(name: str, x: float, y: float) -> str:
    """A leg whose thigh points back and whose shin lies along it."""
    return (
        f'<body name="{name}" pos="{x} {y} 0"><joint name="{name}_roll" axis="1 0 0" range="-40 40"/>'
        f'<joint name="{name}_hip" axis="0 -1 0" range="-360 360"/>'
        f'<geom type="capsule" fromto="0 0 0 -.15 0 0" size=".02"/><body name="{name}_shin" pos="-.15 0 0">'
        f'<joint name="{name}_knee" axis="0 1 0" range="0 180"/>'
        f'<geom type="capsule" fromto="0 0 0 .15 0 0" size=".02"/></body></body>'
    )


def test_legs_that_the_file_folds_are_let_down_alike(tmp_path):
    legs = {"FL": (0.2, 0.12), "FR": (0.2, -0.12), "BL": (-0.2, 0.12), "BR": (-0.2, -0.12)}
    creature, imported = bring(tmp_path, animal("".join(folded(n, *at) for n, at in legs.items())))
    assert imported.stands
    assert "mirror = symmetric" in imported.notes.text()
    angles = dict(zip(creature.joints.names, creature.joints.stand, strict=True))
    for joint in ("hip", "knee"):
        alike = [angles[f"{leg}_{joint}"] for leg in legs]
        np.testing.assert_allclose(alike, alike[0], atol=0.03)


@pytest.mark.usefixtures("a_short_search")
def test_legs_folded_up_beneath_the_trunk_are_no_stance(tmp_path):
    """In the file's pose the body rests on its feet, with its shins beneath its thighs."""
    legs = "".join(
        f'<body name="{name}" pos="{x} {y} 0"><joint name="{name}_hip" axis="0 1 0" range="-90 90"/>'
        f'<joint name="{name}_roll" axis="1 0 0" range="-30 30"/>'
        f'<geom type="capsule" fromto="0 0 0 -.2 0 0" size=".015"/><body name="{name}_shin" pos="-.2 0 0">'
        f'<joint name="{name}_knee" axis="0 1 0" range="-20 150"/>'
        f'<geom type="capsule" fromto="0 0 0 .2 0 -.08" size=".015"/></body></body>'
        for name, (x, y) in {
            "FL": (0.2, 0.2),
            "FR": (0.2, -0.2),
            "BL": (-0.15, 0.2),
            "BR": (-0.15, -0.2),
        }.items()
    )
    creature, imported = bring(tmp_path, animal(legs))
    assert imported.stands
    assert creature.frame.hip_height > 0.15


def test_a_knee_without_limits_bends_to_the_side_it_stands_on(tmp_path):
    """The knees of the file are a little bent; without limits they could bend through."""
    limits = '_knee" type="hinge" axis="0 1 0" range="-70 70"/>'
    assert limits in QUADRUPED
    unlimited = QUADRUPED.replace(limits, '_knee" type="hinge" axis="0 1 0"/>')
    creature, imported = bring(tmp_path, unlimited)
    assert "the file has no limits for" in imported.notes.text()
    joints, data = creature.joints, mujoco.MjData(creature.model)
    knee = joints.names.index("fl_knee")
    for target in (joints.pose_low[knee], joints.pose_high[knee]):
        data.qpos[:] = creature.stand_qpos
        data.qpos[joints.qpos_adr[knee]] = target
        mujoco.mj_kinematics(creature.model, data)
        thigh, shin = creature.model.body("fl_thigh").id, creature.model.body("fl_shin").id
        above = data.xpos[shin] - data.xpos[thigh]
        below = data.geom_xpos[creature.feet.stepping[0]] - data.xpos[shin]
        assert np.cross(above, below)[1] > 0


HOPPER = """<mujoco><compiler angle="degree"/><default><joint type="hinge" axis="0 1 0"/>
<geom type="capsule" size=".04"/></default><worldbody><body name="torso" pos="0 0 1">
<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/><joint name="tip"/>
<geom fromto="0 0 0 0 0 .2" size=".07"/>
<body name="pelvis" pos="0 0 -.05"><joint name="waist" range="-30 30"/><geom fromto="0 0 0 0 0 -.15" size=".06"/>
<body name="thigh" pos="0 0 -.2"><joint name="hip" range="-170 10"/><geom fromto="0 0 0 0 0 -.33"/>
<body name="calf" pos="0 0 -.33"><joint name="knee" range="5 150"/><geom fromto="0 0 0 0 0 -.32" size=".03"/>
<body name="foot" pos="0 0 -.32"><joint name="ankle" range="-45 45"/><geom fromto="-.08 0 0 .17 0 0"/>
</body></body></body></body></body></worldbody></mujoco>"""
"""On one foot; its knee never comes to 0, and by halves of its ranges it would stand on its toe."""


def test_who_has_one_foot_stands_on_all_of_it(tmp_path):
    hopper, imported = bring(tmp_path, HOPPER)
    assert imported.stands
    data = mujoco.MjData(hopper.model)
    data.qpos[:] = hopper.stand_qpos
    mujoco.mj_kinematics(hopper.model, data)
    heel, toe = (data.geom(f"foot_foot_{end}").xpos for end in (1, 2))
    assert abs(toe[2] - heel[2]) < 0.01 * hopper.frame.hip_height


def test_one_leg_swings_widely_in_all_of_its_joints(tmp_path):
    """Of several a hock and a pastern do not; but who hops on one leg bends all of it."""
    hopper, _ = bring(tmp_path, HOPPER)
    span = dict(
        zip(hopper.joints.names, hopper.joints.pose_high - hopper.joints.pose_low, strict=True)
    )
    assert span["knee"] > np.radians(70) > span["waist"]
    assert span["hip"] > np.radians(50)


@pytest.mark.parametrize(("limit", "reads"), [("-1.2 1.2", "radians"), ("-60 60", "")])
def test_angles_are_in_radians_where_degrees_would_leave_no_room(tmp_path, limit, reads):
    """Some files rely on a program that adds <compiler angle="radian">."""
    legs = "".join(
        limb(name, at, f'<joint name="{name}" axis="0 1 0" range="{limit}"/>')
        for name, at in CORNERS.items()
    )
    creature, imported = bring(tmp_path, animal(legs).replace('<compiler angle="degree"/>', ""))
    assert ("angles read as radians" in imported.notes.text()) == bool(reads)
    assert creature.joints.pose_high.max() > 0.3


@pytest.mark.usefixtures("a_short_search")
def test_a_shin_of_which_only_the_foot_is_drawn_is_drawn_whole(tmp_path):
    """Some files draw meshes, and for a shin without one only its foot."""
    shin = '<geom type="capsule" fromto="0 0 0 0 0 -.15" size=".02"/></body></body>'
    foot = '<geom type="sphere" pos="0 0 -.15" size=".021" group="2" contype="0" conaffinity="0"/>'
    legs = "".join(
        limb(
            name,
            at,
            f'<joint name="{name}_hip" axis="0 1 0" range="-60 60"/>',
            f'<joint name="{name}_knee" axis="0 1 0" range="-70 70"/>',
        ).replace(
            shin, shin.replace("size", 'group="3" size').replace("</body>", foot + "</body>", 1)
        )
        for name, at in CORNERS.items()
    )
    creature, _ = bring(tmp_path, animal(legs))
    model = creature.model
    drawn = model.geom_rbound[
        (model.geom_bodyid == model.body("FL_shin").id) & (model.geom_group < 3)
    ]
    assert drawn.max() > 0.07
