"""Importing small animals with the faults of real files: repaired, found or refused."""

import dataclasses
import os
import re
import shutil
import tomllib
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import altered, pose_champion
from importer.models import BIPED, CORNERS, QUADRUPED, ROLLING, bring, told

from mjxgait.api.bodies import write_folder
from mjxgait.certification.trials import simulate
from mjxgait.champion import Champion
from mjxgait.cli import main
from mjxgait.cli.training import _layers
from mjxgait.config.layers import find_creature, resolve_config
from mjxgait.creature import Creature, load_creature
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model
from mjxgait.importer.portrait import facts, portrait
from mjxgait.importer.stand_test import stand_test
from mjxgait.importer.write_toml import _quoted
from mjxgait.reference.starts import perturbed_starts

DIGITS = 1e-5
"""MuJoCo writes numbers with six digits."""


def test_a_quadruped_stands_on_four_feet_and_knows_its_left_and_right(tmp_path):
    creature, imported = bring(tmp_path, QUADRUPED)
    assert imported.stands
    assert len(creature.feet.names) == 4
    assert creature.mirror.symmetric
    names = creature.joints.names
    assert names[creature.mirror.partner[names.index("fl_knee")]] == "fr_knee"
    assert stand_test(creature).stands
    for words in (
        "free joint added",
        "sensor",
        "neck frozen",
        "cylinder",
        "actuators dropped",
        "options replaced",
        "[high]",
    ):
        assert told(imported, words), words
    assert creature.corrections.steer_stride[names.index("fl_hip")] == 0.5
    assert creature.corrections.steer_stride[names.index("fr_hip")] == -0.5


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ('dog 🦿 "a" \\ #b', 'dog 🦿 "a" \\ #b'),
        ("two\nlines\x7f\x01\t\x85.", "two lines    ."),
        (b"not Unicode \xff", "not Unicode \ufffd"),
    ],
    ids=["emoji, quotes and backslash", "control characters", "bytes"],
)
def test_a_file_may_have_any_name(tmp_path: Path, file: str | bytes, told: str):
    """The name is told in creature.toml, in a text and in a comment."""
    model = tmp_path / f"{os.fsdecode(file)}.xml"
    model.write_text(QUADRUPED, encoding="utf-8")
    write_folder(tmp_path / "mine", import_model(model, ImportChoices(apart=False)))
    creature = load_creature(tmp_path / "mine")
    assert creature.settings.creature.description == f"imported from {told}.xml: 8 joints"
    text = (tmp_path / "mine" / "creature.toml").read_text(encoding="utf-8")
    assert f"# Made by `mjxgait import` from {told}.xml." in text
    assert "# high: the body that all limbs hang on" in text


@pytest.mark.parametrize("text", ["🦿", 'a "b" \\ c', "a\nb\x00\x1f\x7f\x85", "'''", "ü\u200b", ""])
def test_texts_come_back_from_creature_toml_as_they_were(text: str):
    assert tomllib.loads(f"name = {_quoted(text)}") == {"name": text}


@pytest.mark.usefixtures("a_short_search")
def test_a_body_shorter_than_its_legs_is_as_long_as_they_are(tmp_path):
    """Speeds are wanted and judged in body lengths; a biped measured from back to toes would be
    praised for shuffling.
    """
    for kind, text in (("urdf", BIPED), ("xml", QUADRUPED)):
        creature, imported = bring(tmp_path, text, kind)
        assert told(imported, "body_length") == (text is BIPED)
        assert creature.frame.body_length > 0.95 * creature.frame.hip_height


@pytest.mark.usefixtures("a_short_search")
def test_joints_with_heavy_rotors_are_stiff_and_strong_enough_to_stride(tmp_path):
    """The rotor inertia of gym's ant is a hundred times what its weight needs: with gains from
    the weight alone it moves in slow motion.
    """
    slow, _ = bring(tmp_path, QUADRUPED)
    quick, imported = bring(
        tmp_path, QUADRUPED.replace("<default>", '<default><joint armature="1"/>')
    )
    pendulum = np.sqrt(9.81 / quick.frame.hip_height)
    assert (np.sqrt(quick.gains.kp / 1.1) > 4 * pendulum).all()
    assert (quick.gains.kd > 0.9 * np.sqrt(quick.gains.kp)).all()
    assert (quick.gains.torque_limit > 5 * slow.gains.torque_limit).all()
    assert told(imported, "own inertia")


@pytest.mark.usefixtures("a_short_search")
def test_the_floor_gives_at_first_touch(tmp_path):
    """A hundredth of the hip height; with MuJoCo's usual impedance loaded feet flicker."""
    for kind, text in (("urdf", BIPED), ("xml", QUADRUPED)):
        creature, _ = bring(tmp_path, text, kind)
        floor = creature.model.geom("floor").solimp
        assert floor[:2].tolist() == [0.35, 0.95]
        assert floor[2] == pytest.approx(0.01 * creature.frame.hip_height, rel=0.15)


def kick(stiffness: str, drop: float) -> float:
    """Greatest force in N of a floor on a ball of 1 kg that touches it with a tenth of its weight.

    stiffness: attributes of the floor. drop: m.
    """
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep=".005"/><worldbody><geom type="plane" size="0 0 .1" priority="1" '
        f'{stiffness}/><body pos="0 0 {0.05 + drop}"><freejoint/><geom size=".05" mass="1"/></body>'
        "</worldbody></mujoco>"
    )
    data, greatest = mujoco.MjData(model), 0.0
    data.xfrc_applied[1, 2] = 0.9 * 9.81
    for _ in range(200):
        mujoco.mj_step(model, data)
        greatest = max(greatest, float(data.qfrc_constraint[2]))
    return greatest


@pytest.mark.usefixtures("a_short_search")
@pytest.mark.parametrize("drop", [0.0005, 0.002])
def test_the_floor_does_not_kick_a_foot_that_barely_touches_it(tmp_path, drop: float):
    creature, _ = bring(tmp_path, QUADRUPED)
    floor = creature.model.geom("floor")
    spring = f'solref="{" ".join(map(str, floor.solref))}"'
    usual = kick(spring, drop)
    assert kick(f'{spring} solimp="{" ".join(map(str, floor.solimp))}"', drop) < 0.5 * usual


def motionless(creature: Creature, gains: dict[str, float]) -> Champion:
    """A gait whose only pose is the stance."""
    return pose_champion(creature, np.tile(creature.joints.stand, (2, 1)), gains)


@pytest.mark.parametrize("axis", ["pitch", "roll"])
def test_it_stands_with_the_strongest_balance_feedback(tmp_path, axis):
    """A loop that is too strong for the body shakes a standing creature off its feet; then
    hardly any genome survives to be improved.
    """
    creature, _ = bring(tmp_path, ROLLING)
    ranges = resolve_config(creature.settings.train, creature.name).controller.tuning
    gains = {name: getattr(ranges, name)[1] for name in (axis, f"{axis}_rate")}
    starts = perturbed_starts(creature, 8, np.random.default_rng(0))
    assert getattr(creature.corrections, f"balance_{axis}").any()
    assert simulate(creature, motionless(creature, gains), starts, 4.0).stayed_up.all()
    # The test can fail: with the full weights it does.
    full = np.sign(creature.corrections.balance_roll)
    loud = altered(creature, corrections={"balance_roll": full})
    assert (
        axis == "pitch" or not simulate(loud, motionless(loud, gains), starts, 4.0).stayed_up.all()
    )


@pytest.mark.usefixtures("a_short_search")
def test_mujoco_reads_the_same_masses_and_joints_from_both_files(tmp_path):
    creature, _ = bring(tmp_path, QUADRUPED)
    before = mujoco.MjModel.from_xml_string(QUADRUPED)
    for name in creature.joints.names:
        a, b = before.joint(name), creature.model.joint(name)
        np.testing.assert_allclose(a.axis, b.axis, atol=DIGITS)
        np.testing.assert_allclose(a.pos, b.pos, atol=DIGITS)
    np.testing.assert_allclose(before.body_mass.sum(), creature.frame.mass, rtol=DIGITS)
    np.testing.assert_allclose(
        np.sort(before.body_inertia.ravel()),
        np.sort(creature.model.body_inertia.ravel()),
        rtol=DIGITS,
    )


@pytest.mark.usefixtures("a_short_search")
def test_frozen_joints_keep_what_is_below_in_its_place(tmp_path):
    """Hips that cannot be at zero are frozen in the middle of their range."""
    text = QUADRUPED.replace('axis="0 1 0" range="-60 60"', 'axis="0 1 0" range="10 40"')
    creature, _ = bring(tmp_path, text, freeze=("*_hip",))
    before, after = mujoco.MjModel.from_xml_string(text), creature.model
    places = []
    for model, trunk, hip in ((before, 1, np.radians(25)), (after, creature.trunk, 0.0)):
        data = mujoco.MjData(model)
        for leg in CORNERS if hip else ():
            data.joint(f"{leg}_hip").qpos = hip
        mujoco.mj_kinematics(model, data)
        knees = [data.joint(f"{leg}_knee").xanchor - data.xpos[trunk] for leg in CORNERS]
        places.append(np.array(knees) @ data.xmat[trunk].reshape(3, 3))
    np.testing.assert_allclose(*places, atol=DIGITS)


def test_a_urdf_biped_stands_without_its_meshes(tmp_path):
    creature, imported = bring(tmp_path, BIPED, "urdf")
    assert imported.stands
    assert creature.feet.names == ("left_foot", "right_foot")
    assert creature.mirror.symmetric
    assert told(imported, ".dae")
    np.testing.assert_allclose(creature.gains.torque_limit, 40.0)
    hip = creature.joints.names.index("left_hip_roll")
    assert creature.corrections.balance_roll[hip] != 0


@pytest.mark.usefixtures("a_short_search")
@pytest.mark.parametrize("missing", ["mass", "inertia", "all inertia"])
def test_a_broken_inertia_is_mended_and_named(tmp_path, missing):
    broken = {
        "mass": ('<mass value="1.2"/>', '<mass value="-1"/>'),
        "inertia": ('ixx="0.008"', 'ixx="9.0"'),
        "all inertia": ("0.008", "1e-20"),
    }[missing]
    _, imported = bring(tmp_path, BIPED.replace(*broken), "urdf")
    assert told(imported, 'inertia of link "left_thigh"')


@pytest.mark.usefixtures("a_short_search")
def test_degrees_in_a_urdf_are_read_as_degrees(tmp_path):
    creature, imported = bring(
        tmp_path, BIPED.replace('lower="-1.2" upper="1.2"', 'lower="-69" upper="69"'), "urdf"
    )
    assert told(imported, "read as degrees")
    np.testing.assert_allclose(creature.joints.high, np.radians(69), rtol=DIGITS)


def test_y_up_by_gravity_is_turned(tmp_path):
    tilted = QUADRUPED.replace("<option ", '<option gravity="0 -9.81 0" ')
    tilted = tilted.replace(
        '<body name="torso" pos="0 0 0.35">', '<body name="torso" pos="0 0.35 0" euler="-90 0 0">'
    )
    creature, imported = bring(tmp_path, tilted)
    assert imported.stands
    assert (creature.frame.stand_rot @ creature.frame.up)[2] == pytest.approx(1, abs=0.01)


def planar(hip: str = "-60 60", knee: str = "-90 90", ankle: str = "0 1 0") -> str:
    """Two legs in one plane, with ankles; ranges in degrees, and the ankles' axis."""
    legs = "".join(
        f'<body name="{n}_thigh"><joint name="{n}_hip" axis="0 1 0" range="{hip}"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/>'
        f'<body name="{n}_shin" pos="0 0 -.3"><joint name="{n}_knee" axis="0 1 0" range="{knee}"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/><body pos="0 0 -.3">'
        f'<joint name="{n}_ankle" axis="{ankle}" range="-40 40"/>'
        '<geom type="capsule" fromto="-.06 0 0 .12 0 0" size=".03"/></body></body></body>'
        for n in ("left", "right")
    )
    return (
        '<mujoco><worldbody><body name="torso" pos="0 0 .7"><joint name="rootx" type="slide" axis="1 0 0"/>'
        '<joint name="rootz" type="slide" axis="0 0 1"/><joint name="rooty" axis="0 1 0"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 .4" size=".05"/>{legs}</body></worldbody></mujoco>'
    )


def test_a_joint_at_the_end_of_its_range_rests_on_it(tmp_path):
    """Hips and knees that only bend backwards, as those of gym's walker: it stands straight."""
    creature, imported = bring(tmp_path, planar(hip="0 90", knee="0 120"))
    model = creature.model
    limited = {model.joint(j).name for j in np.flatnonzero(model.jnt_limited)}
    assert limited == {"left_hip", "left_knee", "right_hip", "right_knee"}
    assert told(imported, "limits act on left_hip, left_knee, right_hip, right_knee only")


def test_a_planar_walker_gets_wide_feet(tmp_path):
    creature, imported = bring(tmp_path, planar())
    assert imported.stands
    assert told(imported, "widened across")
    assert not creature.model.jnt_limited.any(), "it stands bent, and no limit bears it"
    assert creature.settings.creature.planar
    assert creature.joints.names[creature.mirror.partner[0]] == "right_hip"
    assert creature.model.nv == 6 + 6


@pytest.mark.usefixtures("a_short_search")
def test_legs_that_leave_their_plane_do_not_pass_each_other(tmp_path):
    """Ankles that turn 4 degrees askew: it loads all the same, and says nothing of a plane."""
    creature, _ = bring(tmp_path, planar(ankle="0.07 1 0"))
    assert not creature.settings.creature.planar


LOOP = '<equality><connect body1="fl_shin" body2="fr_shin" anchor="0 0 0" name="rod"/></equality>'
REFUSALS = {
    "no legs": (
        "<mujoco><worldbody><body name='ball'><freejoint/><geom size='1'/></body></worldbody></mujoco>",
        '"ball" has no hinge joint',
    ),
    "no body": ("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", "no body"),
    "loop": (QUADRUPED.replace("<actuator>", LOOP + "<actuator>"), '"rod" closes a loop between'),
    "not a model": ("<html/>", "begins with <html>"),
    "doctype": ("<!DOCTYPE x []><mujoco/>", "document type"),
    "include": ('<mujoco><include file="../x.xml"/></mujoco>', "include"),
    "arms only": (
        '<mujoco><worldbody><body name="base"><geom type="box" size=".2 .2 .5"/><body name="arm" pos="0 0 .5"><joint axis="0 1 0" '
        'range="-9 9"/><geom type="capsule" fromto="0 0 0 0 0 .4" size=".03"/></body></body></worldbody></mujoco>',
        "no limb reaches the floor",
    ),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refusals_name_the_element_in_one_sentence(tmp_path, case):
    text, words = REFUSALS[case]
    with pytest.raises(UserError, match=words) as caught:
        bring(tmp_path, text)
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("a_short_search")
def test_no_mesh_outside_the_model_s_folder_is_read(tmp_path):
    """The same file is used from inside and ignored outside, through a path, an absolute path
    and a link.
    """
    home = tmp_path / "home"
    home.mkdir()
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    mesh = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + faces
    for place in (home / "inside.obj", tmp_path / "outside.obj"):
        place.write_text(mesh)
    (home / "link.obj").symlink_to(tmp_path / "outside.obj")
    for reference, found in (
        ("inside.obj", True),
        ("../outside.obj", False),
        (str(tmp_path / "outside.obj"), False),
        ("link.obj", False),
    ):
        text = QUADRUPED.replace("<asset>", f'<asset><mesh name="s" file="{reference}"/>')
        text = text.replace('<site name="imu"/>', '<geom type="mesh" mesh="s" mass="0"/>')
        creature, imported = bring(home, text)
        assert (creature.model.nmesh == 1) == found
        assert told(imported, "not found in the model's folder") != found
    _, imported = bring(home, text.replace("link.obj", "outside.obj"), search=(tmp_path,))
    assert not told(imported, "dropped: not found")


@pytest.mark.usefixtures("a_short_search")
def test_joints_are_kept_and_frozen_as_told(tmp_path):
    creature, _ = bring(tmp_path, QUADRUPED, keep=("neck",), freeze=("f*_knee",))
    assert "neck" in creature.joints.names
    assert "fl_knee" not in creature.joints.names


@pytest.mark.usefixtures("a_short_search")
def test_the_command_writes_a_folder_and_check_draws_it(tmp_path, capsys):
    model = tmp_path / "robot.urdf"
    model.write_text(BIPED)
    with pytest.raises(SystemExit) as ended:
        main(["import", str(model), "--out", str(tmp_path / "mine")])
    assert ended.value.code == 0
    assert "Changes:" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main(["check", str(tmp_path / "mine"), "--out", str(tmp_path / "look.png")])
    assert ended.value.code == 0
    assert "left_knee <-> right_knee" in capsys.readouterr().out
    assert (tmp_path / "look.png").stat().st_size > 5000


@pytest.mark.thorough("end_to_end/test_commands checks and draws each; the stool is drawn below")
def test_every_shipped_creature_can_be_drawn(shipped):
    assert portrait(shipped).size == (1100, 760)
    assert shipped.name in facts(shipped, stand_test(shipped))[0]


def test_a_creature_can_be_drawn_and_told_of(stool: Creature):
    assert portrait(stool).size == (1100, 760)
    assert stool.name in facts(stool, stand_test(stool))[0]


def test_check_fails_where_the_creature_does_not_stand(tmp_path, capsys):
    """The tall quadruped with joints as weak as a puppet's."""
    folder = tmp_path / "fallen"
    shutil.copytree(find_creature("tall_quadruped"), folder)
    text = (folder / "creature.toml").read_text()
    weak = re.sub(r"(?m)^kp = .*", "kp = 0.01", re.sub(r"(?m)^kd = .*", "kd = 0.001", text))
    assert weak != text
    (folder / "creature.toml").write_text(weak)
    with pytest.raises(SystemExit) as ended:
        main(["check", str(folder), "--out", str(tmp_path / "look.png")])
    assert ended.value.code == 1
    assert "does not stand" in capsys.readouterr().out


@pytest.mark.usefixtures("a_short_search")
def test_train_takes_a_model_file(tmp_path):
    model = tmp_path / "robot.xml"
    model.write_text(QUADRUPED)
    creature, _ = _layers(["--env", str(model)])
    assert creature.name == "robot"


@pytest.mark.usefixtures("a_short_search")
@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ("40", "stated for 8 of 8 joints"),
        ("9000", "stated for 8 of 8 joints; cut for 8 to three times what walking needs"),
        ("3", "stated for 8 of 8 joints; too little for 8; else from weight times hip height"),
    ],
)
def test_the_report_says_what_became_of_stated_torques(stated: str, said: str, tmp_path: Path):
    file = tmp_path / "biped.urdf"
    file.write_text(BIPED.replace('effort="40"', f'effort="{stated}"'), encoding="utf-8")
    notes = import_model(file, ImportChoices(apart=False)).notes.text()
    line = next(line for line in notes.splitlines() if "torque_limit" in line)
    assert said in line


@pytest.mark.parametrize(
    ("choices", "said"),
    [
        (ImportChoices(keep=("zzz",)), '--keep: no joint of the file matches "zzz"'),
        (ImportChoices(freeze=("left_hip_rol",)), 'did you mean "left_hip_roll"'),
        (ImportChoices(search=(Path("nowhere"),)), "--search nowhere: no such folder"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(
    choices: ImportChoices, said: str, tmp_path: Path
):
    file = tmp_path / "biped.urdf"
    file.write_text(BIPED, encoding="utf-8")
    with pytest.raises(UserError, match=said):
        import_model(file, dataclasses.replace(choices, apart=False))
