"""Arms of figures: they hang where the skeleton spreads them, and swing with the opposite leg."""

import dataclasses
import re
from pathlib import Path

import jax
import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from animation.skinned import frames_of, treading_loop
from importer.rigs import Bone, bvh, glb
from importer.test_characters import BIRD, REX, sided
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.read_text import rig_of_bvh
from mjxgait.animation.export import build_onto, read_character, standing_still
from mjxgait.animation.keys import bring
from mjxgait.config.evolution import EvolutionConfig
from mjxgait.controllers.key_poses.config import PoseConfig
from mjxgait.controllers.key_poses.controller import PoseTracker
from mjxgait.creature import Creature
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of
from mjxgait.importer import ImportChoices, Imported, import_model
from mjxgait.importer.notes import Notes
from mjxgait.importer.rig import Plan
from mjxgait.importer.rig_arms import hanging
from mjxgait.importer.rig_radii import radii_of
from mjxgait.importer.rigged import source_of_rig

ARM: dict[str, Bone] = {
    "Collar": ("Chest", (3, 140, 0), None),
    "Arm": ("Collar", (18, 140, 0), None),
    "Forearm": ("Arm", (46, 140, 0), None),
    "Hand": ("Forearm", (72, 140, 0), (88, 140, 0)),
}
LEG: dict[str, Bone] = {
    "Thigh": ("Hips", (9, 92, 0), None),
    "Shin": ("Thigh", (9, 50, 2), None),
    "Foot": ("Shin", (9, 8, -2), (9, 2, 18)),
}
FIGURE: dict[str, Bone] = {
    "Hips": ("", (0, 98, 0), None),
    "Chest": ("Hips", (0, 115, 0), None),
    "Head": ("Chest", (0, 150, 0), (0, 172, 0)),
    **sided(ARM | LEG),
}
"""A person with spread arms."""
SHARE = 0.6


def planned(tmp_path: Path, bones: dict[str, Bone]) -> Plan:
    file = tmp_path / "rig.bvh"
    file.write_text(bvh(bones))
    return Plan(1, rig_of_bvh(file).scaled(0.01))


def hung_of(plan: Plan) -> tuple[Plan, dict[int, Rotation]]:
    return hanging(plan, radii_of(plan))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arms") / "figure.glb"
    path.write_bytes(glb(FIGURE))
    return path


@pytest.fixture(scope="module")
def imported(file: Path) -> Imported:
    return import_model(file, ImportChoices(apart=False))


@pytest.fixture(scope="module")
def creature(imported: Imported) -> Creature:
    return creature_of(imported.files)


def at_rest(creature: Creature, model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = creature.rest_qpos
    mujoco.mj_kinematics(model, data)
    return data


def test_spread_arms_hang_and_clear_the_legs(tmp_path: Path):
    plan = planned(tmp_path, FIGURE)
    hung, turns = hung_of(plan)
    rig = hung.rig
    names = list(rig.names)
    assert {names[bone] for bone in turns} == {"LArm", "RArm"}
    for side in "LR":
        arm, hand = (rig.places[names.index(side + part)] for part in ("Arm", "Hand"))
        assert np.linalg.norm(hand - arm) == pytest.approx(0.54), "no bone changes its length"
        assert hand[1] - arm[1] < -0.54 * np.cos(np.radians(41))
        assert abs(hand[0]) > abs(arm[0]), "outwards"
    moved = [
        name for name, a, b in zip(names, rig.places, plan.rig.places, strict=True) if any(a != b)
    ]
    assert {name[1:] for name in moved} == {"Forearm", "Hand"}


def test_without_collar_bones_the_whole_arm_hangs(tmp_path: Path):
    bones = {name: bone for name, bone in FIGURE.items() if not name.endswith("Collar")}
    for side in "LR":
        bones[side + "Arm"] = ("Chest", bones[side + "Arm"][1], None)
    plan = planned(tmp_path, bones)
    assert {plan.rig.names[bone] for bone in hung_of(plan)[1]} == {"LArm", "RArm"}


def test_arms_hang_beside_wide_hips(tmp_path: Path):
    wide = FIGURE | {
        side + name: (side + parent if parent != "Hips" else parent, (sign * 24, *place[1:]), end)
        for side, sign in (("L", 1), ("R", -1))
        for name, (parent, place, end) in LEG.items()
        if name != "Foot"
    }
    plan = planned(tmp_path, wide)
    hung, _ = hung_of(plan)
    radii, names = radii_of(hung), list(hung.rig.names)
    places = {name: hung.rig.places[names.index(name)] for name in names}
    thick = radii[names.index("LThigh")] + radii[names.index("LForearm")]
    share = np.linspace(0, 1, 50)[:, None]
    thigh = (1 - share) * places["LThigh"] + share * places["LShin"]
    forearm = (1 - share) * places["LForearm"] + share * places["LHand"]
    assert np.linalg.norm(thigh[:, None] - forearm, axis=2).min() > thick
    assert places["LArm"][0] < places["LThigh"][0] < places["LHand"][0]


def test_wings_and_arms_that_hang_already_stay(tmp_path: Path):
    down = sided(
        {
            "Collar": ("Chest", (3, 140, 0), None),
            "Arm": ("Collar", (18, 140, 0), None),
            "Forearm": ("Arm", (22, 112, 0), None),
            "Hand": ("Forearm", (24, 86, 2), (24, 72, 3)),
        }
    )
    below = sided(
        {
            "Collar": ("Hips", (3, 94, 0), None),
            "Arm": ("Collar", (18, 94, 0), None),
            "Forearm": ("Arm", (46, 94, 0), None),
            "Hand": ("Forearm", (72, 94, 0), (88, 94, 0)),
        }
    )
    for bones in (BIRD, REX, FIGURE | down, FIGURE | below):
        plan = planned(tmp_path, bones)
        hung, turns = hung_of(plan)
        rig = hung.rig
        assert not turns
        assert (rig.places == plan.rig.places).all()


LONG = FIGURE | {
    side + "Hand": (side + "Forearm", (sign * 120, 140, 0), (sign * 150, 140, 0))
    for side, sign in (("L", 1), ("R", -1))
}
"""Hands that would reach the floor."""


def test_a_hand_that_would_reach_the_floor_stays(tmp_path: Path):
    assert not hung_of(planned(tmp_path, LONG))[1]


@pytest.mark.parametrize(("bones", "arms"), [(FIGURE, "LR"), (LONG, ""), (BIRD, "")])
def test_only_arms_that_hang_swing(tmp_path: Path, bones: dict[str, Bone], arms: str):
    file = tmp_path / "rig.bvh"
    file.write_text(bvh(bones))
    swings = source_of_rig(file, None, None, Notes()).swings
    assert swings == {f"{side}Arm_pitch" for side in arms}


def test_the_files_rest_is_that_of_its_bones(creature: Creature):
    """`rest_model` has spread arms; the body itself stands with hanging ones."""
    spread, hung = at_rest(creature, creature.rest_model), at_rest(creature, creature.model)
    ahead = np.append(creature.frame.start_axes[0][:2], 0.0)
    left = np.cross([0.0, 0.0, 1.0], ahead)
    for part, (_, place, _) in FIGURE.items():
        away = 0.01 * np.subtract(place, FIGURE["Hips"][1])
        expected = spread.body("Hips").xpos + away[0] * left + [0, 0, away[1]] + away[2] * ahead
        assert spread.body(part).xpos == pytest.approx(expected, abs=2e-4), part
    for side in "LR":
        assert hung.body(side + "Hand").xpos[2] < hung.body(side + "Arm").xpos[2] - 0.4


def test_frozen_arms_are_still(file: Path):
    still = creature_of(
        import_model(file, ImportChoices(apart=False, freeze=("*Arm_pitch",))).files
    )
    assert not still.joints.swings
    assert not [name for name in still.joints.names if "Arm" in name]
    hung = at_rest(still, still.model)
    assert hung.body("LHand").xpos[2] < hung.body("LArm").xpos[2] - 0.4


def test_arms_swing_with_the_leg_of_the_other_side(creature: Creature):
    names = creature.joints.names
    told = {(names[arm], names[leg]): share for arm, leg, share in creature.joints.swings}
    assert told == {
        ("LArm_pitch", "RThigh_pitch"): SHARE,
        ("RArm_pitch", "LThigh_pitch"): SHARE,
    }
    body = [creature.model.joint(name).axis for name in ("LArm_pitch", "RThigh_pitch")]
    assert body[0] @ body[1] == pytest.approx(1.0), "equal angles turn both ahead"
    arm = names.index("LArm_pitch")
    assert creature.gains.kp[arm] < 0.2 * creature.gains.kp[names.index("LThigh_pitch")]


@pytest.mark.parametrize("brought", [False, True])
def test_every_genome_has_them_but_those_of_a_brought_cycle(creature: Creature, brought: bool):
    """An animator's own arms are kept by `refine`."""
    joints, count = creature.joints, 2
    around = tuple(map(float, np.tile(joints.stand, count))) if brought else ()
    config = dataclasses.replace(PoseConfig(), key_poses=count, around=around, within=20.0)
    variation = PoseTracker(creature, 0.005).variation(config, EvolutionConfig())
    made = variation.create(key_of(1), 6)
    one = jax.tree.map(lambda leaf: leaf[2], made)
    changed = jax.vmap(variation.mutate, (0, None))(jax.random.split(key_of(2), 40), one)
    assert float(np.ptp(np.asarray(changed.key_poses), axis=0).max()) > 0.1
    for poses in (np.asarray(made.key_poses), np.asarray(changed.key_poses)):
        for arm, leg, share in joints.swings:
            wanted = joints.stand[arm] + share * (poses[..., leg] - joints.stand[leg])
            wanted = np.clip(wanted, joints.pose_low[arm], joints.pose_high[arm])
            follows = np.allclose(poses[..., arm], wanted, atol=1e-6)
            assert follows != brought


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('leg = "RThigh_pitch"', 'leg = "RThigh_pitsch"', 'no joint is called "RThigh_pitsch"'),
        ('leg = "RThigh_pitch"', 'leg = "RArm_pitch"', "itself swings with another joint"),
        ('"LArm" = [', '"LArn" = [', 'rig.turned = "LArn"'),
    ],
)
def test_a_wrong_table_is_refused(imported: Imported, old: str, new: str, said: str):
    files = dict(imported.files)
    assert old in files["creature.toml"]
    files["creature.toml"] = files["creature.toml"].replace(old, new)
    with pytest.raises(UserError, match=re.escape(said)):
        creature_of(files)


def test_the_characters_own_arms_hang_in_its_walk(creature: Creature, file: Path):
    loop = standing_still(treading_loop(creature))
    names, data = build_onto({"idle": loop}, read_character(file))
    document = gltf.GLTF2.load_from_bytes(data)
    poses = frames_of(document, names["idle"])[0]
    place = {node.name: poses[i][:3, 3] for i, node in enumerate(document.nodes) if i in poses}
    simulated = mujoco.MjData(creature.model)
    simulated.qpos[:] = loop.qpos[0]
    mujoco.mj_kinematics(creature.model, simulated)
    for side in "LR":
        arm, hand = (simulated.body(side + part).xpos for part in ("Arm", "Hand"))
        shown = place[side + "Hand"] - place[side + "Arm"]
        assert shown[1] == pytest.approx(hand[2] - arm[2], abs=1e-3)
        assert np.linalg.norm(shown) == pytest.approx(0.54, abs=1e-3)
        assert shown[1] < -0.4


def test_a_cycle_of_the_file_is_read_from_its_own_rest(
    creature: Creature, file: Path, tmp_path: Path
):
    """In a clip arms hang by a turn of about 80 degrees from rest; for the body that is none."""
    quat = np.array(creature.settings.rig.turned["LArm"])
    angle = float(np.degrees(2 * np.arccos(quat[0])))
    assert 60 < angle < 90
    own = tmp_path / "own.glb"
    own.write_bytes(build_onto({"walk": treading_loop(creature)}, read_character(file))[1])
    brought = bring(creature, own)
    arm = creature.joints.names.index("LArm_pitch")
    assert brought.track.angles[:, arm] == pytest.approx(creature.joints.stand[arm], abs=0.1)
    assert brought.track.errors["LArm_pitch"].max() < 0.1, "the hinge can do what the clip shows"
