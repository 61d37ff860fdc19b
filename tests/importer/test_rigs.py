"""A character without a body: of its skeleton, as BVH or as a skinned GLB, a creature is made."""

import contextlib
import dataclasses
import re
import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest
from importer.rigs import DOG, Bone, bvh, glb, stated_longer
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import Clip
from mjxgait.animation.clips.read_glb import rig_of_glb
from mjxgait.animation.clips.read_text import read_bvh, rig_of_bvh
from mjxgait.animation.keys.retarget import axes_of, retarget
from mjxgait.cli.import_ import import_command
from mjxgait.creature import Creature
from mjxgait.creature.load import creature_of
from mjxgait.creature.scale import scaled
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, Imported, import_model
from mjxgait.importer.notes import Notes
from mjxgait.importer.rig import Plan
from mjxgait.importer.rig_hinges import Hinge, hinges_of
from mjxgait.importer.rig_radii import FOLDED, apart, points_along, radii_of, slimmer
from mjxgait.importer.rigged import source_of_rig

FEET = ["LeftHand", "RightHand", "LeftHock", "RightHock"]
SPIDER: dict[str, Bone] = {"Trunk": ("", (0, 10, 0), (0, 10, 8))} | {
    f"{name}{part}": (parent and (f"{name}{parent}" if part == "Shin" else parent), place, end)
    for name, sign, z in (("L1", 1, 6), ("L2", 1, -6), ("R1", -1, 6), ("R2", -1, -6))
    for part, parent, place, end in (
        ("Thigh", "Trunk", (4 * sign, 10, z), None),
        ("Shin", "Thigh", (20 * sign, 12, z), (24 * sign, 0, z)),
    )
}
HUMAN: dict[str, Bone] = {
    "Hips": ("", (0, 95, 0), None),
    "Head": ("Hips", (0, 150, 0), (0, 175, 0)),
}
HUMAN |= {
    f"{side}{name}": (f"{side}{parent}" if parent != "Hips" else parent, (sign * 10, y, z), end)
    for side, sign in (("L", 1), ("R", -1))
    for name, parent, y, z, end in (
        ("Thigh", "Hips", 90, 0, None),
        ("Shin", "Thigh", 48, 0, None),
        ("Foot", "Shin", 8, 0, (sign * 10, 2, 16)),
    )
}


def made(folder: Path, kind: str) -> Path:
    file = folder / f"dog.{kind}"
    file.write_bytes(glb() if kind == "glb" else bvh().encode())
    return file


@pytest.fixture(scope="module", params=["bvh", "glb"])
def dog(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Imported:
    file = made(tmp_path_factory.mktemp("rig"), request.param)
    return import_model(file, ImportChoices(apart=False))


@pytest.fixture(scope="module")
def creature(dog: Imported) -> Creature:
    return creature_of(dog.files)


def test_it_stands_on_its_four_feet(dog: Imported, creature: Creature):
    assert dog.stands
    assert sorted(name.removesuffix("_foot") for name in creature.feet.names) == sorted(FEET)
    assert creature.mirror.symmetric


def test_its_parts_can_be_scaled(creature: Creature):
    """Also where the standing pose is the zero pose, which MuJoCo leaves out of the file."""
    xml = creature.files["creature.xml"]
    plain = re.sub(r'(<key name="\w+") qpos="[^"]*"', r"\1", xml)
    longer = scaled(creature_of({**creature.files, "creature.xml": plain}), {"*Shin": 1.2})
    assert longer.frame.hip_height > 1.02 * creature.frame.hip_height


def test_its_joints_are_where_its_bones_begin(creature: Creature):
    """Forward is the file's Z, left its X."""
    model, data = creature.model, mujoco.MjData(creature.model)
    mujoco.mj_kinematics(model, data)
    trunk = data.xmat[creature.trunk].reshape(3, 3)
    for name, (_, place, _) in DOG.items():
        x, y, z = 0.01 * (np.array(place) - DOG["Hips"][1])
        at = (data.body(name).xpos - data.xpos[creature.trunk]) @ trunk
        axes = np.stack([creature.frame.left, creature.frame.up, creature.frame.forward])
        assert axes @ at == pytest.approx([x, y, z], abs=1e-4), name


def test_its_own_cycles_count_from_where_its_bones_rest(dog: Imported, tmp_path: Path):
    """Wherever it stands: here with its knees bent."""
    xml = dog.files["creature.xml"]
    stand = creature_of(dog.files)
    qpos = stand.stand_qpos.copy()
    knee = stand.joints.names.index("LeftShin_pitch")
    qpos[stand.joints.qpos_adr[[knee, stand.mirror.partner[knee]]]] += 0.2
    bent = re.sub(r'(name="stand" qpos=)"[^"]*"', rf'\1"{" ".join(map(str, qpos))}"', xml)
    creature = creature_of({**dog.files, "creature.xml": bent})
    file = tmp_path / "walk.bvh"
    file.write_text(bvh(turned={"LeftShin": 20.0}))
    clip = read_bvh(file)
    names = {name: name for name in ("Hips", "LeftThigh", "LeftShin")}
    found = retarget(creature, clip, names, np.roll(np.eye(3), -1, axis=0))
    assert np.degrees(found.angles[:, knee]) == pytest.approx([0.0, 20.0], abs=0.1)


def test_legs_swing_and_spread_at_the_trunk_and_bend_below(creature: Creature):
    names = set(creature.joints.names)
    for side in ("Left", "Right"):
        assert {f"{side}Thigh_pitch", f"{side}Thigh_roll", f"{side}Shin_pitch"} <= names
        assert f"{side}Shin_roll" not in names
    assert "Neck_pitch" not in names  # no leg hangs on it


def test_every_guess_is_told(dog: Imported):
    told = dog.notes.text()
    for what in ("height = ", "density = 1000 kg/m³", "hinges of LeftShin, RightShin", "shapes = "):
        assert what in told
    assert told in dog.files["README.md"]


def test_of_a_skin_its_bones_are_as_thick_as_it(tmp_path: Path):
    """And what moves no skin, such as handles of a rig, is no part of the body."""
    tree = source_of_rig(made(tmp_path, "glb"), None, None, Notes()).tree
    bodies = {body.get("name"): body for body in tree.iter("body")}
    assert set(bodies) == set(DOG)
    for leg in ("LeftThigh", "RightShin", "LeftForearm"):
        (geom,) = bodies[leg].findall("geom")
        assert float(geom.get("size", "0")) == pytest.approx(0.03, rel=1e-3)


@pytest.mark.parametrize(
    ("factor", "height", "tall"), [(0.01, None, 0.62), (1, None, 0.62), (10, None, 0.62), (7, 2, 2)]
)
def test_the_unit_is_that_of_a_creatures_size_or_as_told(tmp_path, factor, height, tall):
    scaled = {
        name: (parent, *(p and tuple(factor * v for v in p) for p in points))
        for name, (parent, *points) in DOG.items()
    }
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(scaled))
    notes = Notes()
    source_of_rig(file, None, height, notes)
    assert next(g for g in notes.guesses if g.what == "height").value == f"{tall:g} m"


def hinges(folder: Path, bones: Mapping[str, Bone]) -> dict[str, list[Hinge]]:
    file = folder / "rig.bvh"
    file.write_text(bvh(bones))
    plan = Plan(1, rig_of_bvh(file))
    return dict(zip(plan.rig.names, hinges_of(plan), strict=True))


def upright(bones: Mapping[str, Bone]) -> dict[str, Bone]:
    """The same in a file that has Z up, as Blender writes BVH."""
    return {
        name: (parent, *(p and (p[0], -p[2], p[1]) for p in points))
        for name, (parent, *points) in bones.items()
    }


@pytest.mark.parametrize("bones", [DOG, HUMAN, SPIDER])
def test_up_is_where_limbs_come_down_to_the_floor(tmp_path: Path, bones: Mapping[str, Bone]):
    file = tmp_path / "rig.bvh"
    for kind, up in ((bones, "y"), (upright(bones), "z")):
        file.write_text(bvh(kind))
        assert source_of_rig(file, None, None, Notes()).up.value == up
    file.write_text(bvh(bones))
    assert source_of_rig(file, "z", None, Notes()).up.value == "z"  # as told


def test_ears_are_no_limbs(tmp_path: Path):
    """What is short does not make its bone part of the trunk, which bends between the limbs."""
    ears = {
        side + "Ear": ("Head", (3 * sign, 64, 32), (5 * sign, 70, 30))
        for side, sign in (("Left", 1), ("Right", -1))
    }
    found, bare = hinges(tmp_path, DOG | ears), hinges(tmp_path, DOG)
    assert [found.pop(name) for name in ears] == [[], []]
    assert {n: [h.name for h in own] for n, own in found.items()} == {
        n: [h.name for h in own] for n, own in bare.items()
    }


def test_a_bone_to_one_leg_is_no_trunk_that_bends(tmp_path: Path):
    pelvis = {f"{side}Pelvis": ("Hips", (0, 48, -28), None) for side in ("Left", "Right")}
    hung = {
        f"{side}Thigh": (f"{side}Pelvis", *DOG[f"{side}Thigh"][1:]) for side in ("Left", "Right")
    }
    found = hinges(tmp_path, DOG | pelvis | hung)
    assert [found[name] for name in pelvis] == [[], []]
    assert len(found["LeftThigh"]) == len(found["Spine"]) == 2


def test_toes_are_one_with_their_foot_and_a_spur_is_no_toe(tmp_path: Path):
    toes = {
        f"{side}{name}": (f"{side}HindPaw", (x * sign, 2, -27), (x * sign, 0, -20))
        for side, sign in (("Left", 1), ("Right", -1))
        for name, x in (("Inner", 6), ("Outer", 10))
    }
    short = {name: bone for name, bone in DOG.items() if "HindPaw" not in name}
    short |= {name: (bone[0].replace("HindPaw", "Hock"), *bone[1:]) for name, bone in toes.items()}
    found = hinges(tmp_path, short)
    assert [len(found[name]) for name in ("LeftHock", "LeftInner", "LeftOuter")] == [1, 0, 0]
    spur = {"LeftTwist": ("LeftThigh", (9, 35, -24), (9, 34, -24))}
    assert len(hinges(tmp_path, DOG | spur)["LeftShin"]) == 1


def test_what_bends_below_a_knee_bends_little(creature: Creature):
    widths = np.degrees(creature.joints.pose_high - creature.joints.pose_low)
    width = dict(zip(creature.joints.names, widths, strict=True))
    assert width["LeftHock_pitch"] == pytest.approx(40.0)
    assert width["LeftShin_pitch"] > 60.0


def test_a_cycle_of_its_own_rig_is_read_in_the_axes_of_that_file(tmp_path: Path):
    """Of another file with the same names in those that its joints can follow better."""
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(upright(DOG)))
    own = creature_of(import_model(file, ImportChoices(apart=False)).files)
    names = ("Hips", "LeftThigh")
    bones = dict(zip(names, names, strict=True))
    for ahead in (np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        turned = np.tile(np.eye(3), (2, 2, 1, 1))
        turned[1, 1] = Rotation.from_rotvec(np.radians(20.0) * ahead).as_matrix()
        clip = Clip(names, (-1, 0), np.array([0.0, 1.0]), turned)
        track = retarget(own, clip, bones, axes_of(own, clip, bones, None))
        roll = track.angles[1, own.joints.names.index("LeftThigh_roll")]
        assert abs(np.degrees(roll)) == pytest.approx(20.0, abs=0.1)


def test_a_knee_that_rests_straight_folds_away_from_the_toes(tmp_path: Path):
    (knee,) = hinges(tmp_path, HUMAN)["LShin"]
    shin = np.array([0.0, -1.0, 0.0])
    farther = knee.high if knee.high > -knee.low else knee.low
    assert np.sign(farther) * np.cross(knee.axis, shin)[2] < 0
    assert knee.confidence == "low"


def test_a_knee_that_rests_bent_never_bends_the_other_way(tmp_path: Path):
    found = hinges(tmp_path, DOG)
    for name, way in (("LeftShin", 1), ("LeftForearm", -1)):
        (knee,) = found[name]
        assert way * (knee.high if way > 0 else knee.low) > way * -knee.low / 2
        assert abs(knee.low if way > 0 else knee.high) < 75.0


def test_three_bones_of_a_leg_move(tmp_path: Path):
    """A shoulder blade, a pelvis or a paw would be a fourth; on two feet an ankle may be one."""
    girdle = {
        f"{side}Blade": ("Chest", (sign * 2, 46, 2), None)
        for side, sign in (("Left", 1), ("Right", -1))
    }
    wrist = {
        f"{side}Wrist": (f"{side}Hand", (8 * sign, 2, 12), (8 * sign, 1, 18))
        for side, sign in (("Left", 1), ("Right", -1))
    }
    hung = {f"{side}Arm": (f"{side}Blade", *DOG[f"{side}Arm"][1:]) for side in ("Left", "Right")}
    found = hinges(tmp_path, DOG | girdle | hung | wrist)
    front = [len(found[f"Left{name}"]) for name in ("Blade", "Arm", "Forearm", "Hand", "Wrist")]
    hind = [len(found[f"Left{name}"]) for name in ("Thigh", "Shin", "Hock", "HindPaw")]
    assert (front, hind) == ([0, 2, 1, 1, 0], [2, 1, 1, 0])


def test_a_hanging_leg_that_is_slightly_bent_aside_bends_ahead(tmp_path: Path):
    paws = {
        f"{side}Hand": (f"{side}Forearm", (11 * sign, 6, 6), (11 * sign, 2, 6))
        for side, sign in (("Left", 1), ("Right", -1))
    }
    upright = {
        f"{side}Arm": ("Chest", (8 * sign, 42, 6), None)
        for side, sign in (("Left", 1), ("Right", -1))
    }
    found = hinges(tmp_path, DOG | paws | upright)
    assert [hinge.name for hinge in found["LeftForearm"]] == ["pitch"]


def test_both_sides_are_as_thick(tmp_path: Path):
    """Of a skin that is thicker on the left; a heavier side leads in a circle."""
    file = tmp_path / "dog.glb"
    file.write_bytes(glb(handles=False))
    rig = rig_of_glb(file)
    skins = tuple(
        (rig.skins[b].mean(0) + 1.4 * (rig.skins[b] - rig.skins[b].mean(0)))
        if name.startswith("Left")
        else rig.skins[b]
        for b, name in enumerate(rig.names)
    )
    plan = Plan(1, dataclasses.replace(rig, skins=skins))
    radii = dict(zip(rig.names, radii_of(plan), strict=True))
    assert radii["LeftThigh"] == radii["RightThigh"] > 1.1 * 0.03
    assert radii["LeftArm"] == radii["RightArm"]


def test_legs_are_slimmer_than_the_space_between_other_parts(tmp_path: Path):
    """Fat shins, which fold against the belly; thighs and arms hang on the trunk."""
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(DOG))
    plan = Plan(1, rig_of_bvh(file))
    names = plan.rig.names
    fat = [10.0 if name.endswith("Shin") else 2.0 for name in names]
    slim = dict(zip(names, slimmer(plan, hinges_of(plan), fat), strict=True))
    assert slim["LeftShin"] == slim["RightShin"] == pytest.approx(8.0)  # 16 cm apart
    assert {slim[name] for name in names if not name.endswith("Shin")} == {2.0}
    fatter = [20.0 if name.endswith("Shin") else 2.0 for name in names]
    slim = dict(zip(names, slimmer(plan, hinges_of(plan), fatter), strict=True))
    assert slim["LeftShin"] == 10.0, "half as thick at least"


def test_a_shin_is_slimmer_than_the_way_to_the_hip(tmp_path: Path):
    """At rest the two touch, and the knee bends: a panda walked with its shins in its hips."""
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(DOG))
    plan = Plan(1, rig_of_bvh(file))
    names, hinges = plan.rig.names, hinges_of(plan)
    shin, hips = names.index("LeftShin"), names.index("Hips")
    way = apart(points_along(plan, shin), points_along(plan, hips))
    fat = [0.01 for _ in names]
    fat[hips], fat[shin] = 0.5 * way, 0.5 * way
    slim = slimmer(plan, hinges, fat)
    assert slim[hips] == fat[hips], "the trunk stays as it is"
    assert slim[shin] + fat[hips] == pytest.approx(FOLDED * way)


def test_an_imported_character_has_slim_legs(tmp_path: Path):
    """Its skin is 10 cm thick, and its shins are 16 cm apart."""
    file = tmp_path / "dog.glb"
    file.write_bytes(glb(thick=0.1))
    tree = source_of_rig(file, None, None, Notes()).tree
    sizes = {b.get("name"): b.find("geom") for b in tree.iter("body")}
    shins = [float(sizes[name].get("size")) for name in ("LeftShin", "RightShin")]
    assert max(shins) == pytest.approx(min(shins))
    assert max(shins) < 0.081


def test_a_body_on_two_feet_has_heels(tmp_path: Path):
    file = tmp_path / "human.bvh"
    file.write_text(bvh(HUMAN))
    plan = Plan(1, rig_of_bvh(file))
    foot = plan.rig.names.index("LFoot")
    ((heel, toe),) = plan.sole(foot, 1.0)
    assert heel == pytest.approx([10.0, 3.0, -4.0])
    assert toe == pytest.approx([10.0, 3.0, 16.0])
    assert len(plan.capsules(foot, 1.0)) == 1  # whose upper part would touch before the sole
    spurs = {f"{side}Heel": (f"{side}Foot", (0, 0, -6), (30, 0, -6)) for side in ("L", "R")}
    file.write_text(bvh(HUMAN | spurs))
    plan = Plan(1, rig_of_bvh(file))
    ((heel, toe),) = plan.sole(plan.rig.names.index("LFoot"), 1.0)
    assert (heel[2], toe[2]) == pytest.approx((-6.0, 16.0))
    file.write_text(bvh(DOG))
    assert Plan(1, rig_of_bvh(file)).feet == []


def test_limbs_that_lie_sideways_swing_about_the_upright_axis(tmp_path: Path):
    found = hinges(tmp_path, SPIDER)
    assert [hinge.name for hinge in found["L1Thigh"]] == ["yaw", "roll"]
    assert [hinge.name for hinge in found["L1Shin"]] == ["roll"]


def test_names_lose_what_a_tool_put_before_them(tmp_path: Path):
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(prefix="mixamorig:"))
    source = source_of_rig(file, None, None, Notes())
    tree, bones = source.tree, source.bones
    assert bones == {name: f"mixamorig:{name}" for name in DOG}
    assert {b.get("name") for b in tree.iter("body")} == set(DOG)


def nowhere(data: bytes) -> bytes:
    """The first vertex is at no place."""
    at = 28 + struct.unpack_from("<I", data, 12)[0]
    return data[:at] + struct.pack("<f", np.nan) + data[at + 4 :]


def without_skin(data: bytes) -> bytes:
    return data.replace(b'"skins"', b'"skims"')


BAD: Mapping[str, tuple[str, Callable[[bytes], bytes], str]] = {
    "empty": ("glb", lambda d: b"", "is empty"),
    "no glb": ("glb", lambda d: b"solid cube " * 9, "not a GLB file"),
    "truncated": ("glb", lambda d: d[: len(d) // 2], "is cut off"),
    "longer than it is": ("glb", stated_longer, "is cut off"),
    "no skin": ("glb", without_skin, "has no skin"),
    "place that is no number": ("glb", nowhere, "not a finite number"),
    "a skeleton that does not end": (
        "bvh",
        lambda d: d[: d.index(b"MOTION")],
        "is cut off or damaged",
    ),
    "nan": ("bvh", lambda d: d.replace(b"OFFSET 0 2", b"OFFSET nan 2", 1), "not a finite number"),
    "a point": ("bvh", lambda d: b"HIERARCHY ROOT a { OFFSET 0 0 0 } MOTION", "in one place"),
    "nothing": ("bvh", lambda d: b"HIERARCHY MOTION", "has no bones"),
    "10,000 bones": (
        "bvh",
        lambda d: b"HIERARCHY ROOT a { " + b"JOINT b { OFFSET 0 1 0 } " * 10_000 + b"} MOTION",
        "bones; more than",
    ),
    "a snake": (
        "bvh",
        lambda d: (
            b"HIERARCHY ROOT a { JOINT b { OFFSET 0 0 9 JOINT c { OFFSET 0 0 9 } } "
            b"JOINT d { OFFSET 0 0 -9 JOINT e { OFFSET 0 0 -9 } } } MOTION"
        ),
        "legs",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_sentence_and_nothing_is_written(tmp_path: Path, name: str):
    kind, change, words = BAD[name]
    file = made(tmp_path, kind)
    file.write_bytes(change(file.read_bytes()))
    with pytest.raises(UserError, match=words) as raised:
        import_command([str(file), "--out", str(tmp_path / "out")])
    assert "\n" not in str(raised.value)
    assert str(file) in str(raised.value)
    assert [*tmp_path.iterdir()] == [file]


def test_a_file_of_blender_or_of_gltf_in_parts_has_a_way_out(tmp_path: Path):
    for kind in ("blend", "gltf"):
        (tmp_path / f"dog.{kind}").write_text("x")
        with pytest.raises(UserError, match=r"glTF binary \(\.glb\)"):
            import_model(tmp_path / f"dog.{kind}")


@pytest.mark.parametrize("kind", ["glb", "bvh"])
def test_whatever_happens_to_a_skeleton_on_its_way_there_is_no_traceback(tmp_path, kind):
    """Cut off anywhere, or with bytes changed: a sentence, or a model."""
    file = made(tmp_path, kind)
    whole, rng, sentences = file.read_bytes(), np.random.default_rng(3), []
    head = len(whole) if kind == "bvh" else struct.unpack_from("<I", whole, 12)[0]
    for case in range(100):
        data = bytearray(whole[: rng.integers(1, len(whole))] if case % 4 == 3 else whole)
        for place in rng.integers(0, min(head, len(data)), 1 + case % 7):
            data[place] = rng.integers(32, 127)
        file.write_bytes(bytes(data))
        with contextlib.suppress(UserError):
            try:
                source_of_rig(file, None, None, Notes())
            except UserError as error:
                sentences.append(str(error))
                raise
    assert len(sentences) > 20
    assert not any("\n" in sentence for sentence in sentences)
