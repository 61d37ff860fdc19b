"""Real models: file, creature folder, `load_creature`, standing for two seconds, the same
animal.
"""

import functools
from pathlib import Path

import mujoco
import numpy as np
import pytest
from importer.packages import MODELS, model_file

from mjxgait.api.bodies import write_folder
from mjxgait.creature import load_creature
from mjxgait.creature.geometry import ancestors
from mjxgait.creature.load import creature_of
from mjxgait.creature.overlap import find_crossings
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model
from mjxgait.importer.convert import Imported
from mjxgait.importer.stand_test import stand_test
from mjxgait.physics.derived import observation_layout
from mjxgait.physics.lane_major import UnsupportedModel, lane_major_plant
from mjxgait.physics.lane_major.model import check_supported
from mjxgait.physics.lane_major.padded import difference
from mjxgait.physics.lane_major.topology import Topology

REFUSED = {
    "r2d2": "wheel",
    "panda arm": "no limb reaches the floor",
    "dm swimmer": "no hinge joint below it",
}
FALLS = {"bolt", "berkeley"}
"""Point feet, and soles too short for the weight above them: these stand only while stepping."""
FEET = {
    "gym ant": 4,
    "gym half_cheetah": 2,
    "gym hopper": 1,
    "gym walker2d": 2,
    "dm quadruped": 4,
    "unitree g1": 2,
    "laikago": 4,
    "solo12": 4,
}
MASS = {"gym half_cheetah": 14.0, "solo12": 2.5, "unitree g1": 33.34, "laikago": 25.167}
pytestmark = pytest.mark.slow


@functools.cache
def imported_model(name: str) -> Imported:
    """By default settings, with the limits of a user's import; once for all tests that look."""
    path, search = model_file(name)
    return import_model(path, ImportChoices(search=search))


ALWAYS = {*FALLS, *FEET, *MASS} - {"berkeley", "unitree g1", "solo12", "gym walker2d"}
MORE = pytest.mark.thorough("a model more")


@pytest.mark.parametrize(
    "name",
    [
        name if name in ALWAYS else pytest.param(name, marks=MORE)
        for name in MODELS
        if name not in REFUSED
    ],
)
def test_file_to_standing_creature(tmp_path: Path, name: str):
    imported = imported_model(name)
    write_folder(tmp_path / "mine", imported)
    creature = load_creature(tmp_path / "mine")
    assert stand_test(creature).stands == imported.stands == (name not in FALLS)
    assert len(creature.feet.names) == FEET.get(name, len(creature.feet.names))
    assert creature.frame.mass == pytest.approx(MASS.get(name, creature.frame.mass), rel=1e-3)
    assert (creature.joints.pose_low <= creature.joints.stand + 1e-9).all()
    assert (creature.joints.pose_high >= creature.joints.stand - 1e-9).all()
    assert not creature.model.nu + creature.model.neq + creature.model.ntendon
    assert imported.notes.changes
    assert {"forward", "trunk", "feet", "standing pose", "mirror", "kp, kd"} <= {
        g.what for g in imported.notes.guesses
    }
    try:
        check_supported(creature.evolution_model)
    except UnsupportedModel as reason:
        pytest.fail(f"the fast physics cannot simulate it: {reason}")


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_walk_is_refused_in_one_sentence(name: str):
    path, search = model_file(name)
    with pytest.raises(UserError, match=REFUSED[name]):
        import_model(path, ImportChoices(search=search, apart=False))


def test_the_ant_is_the_same_animal(tmp_path: Path):
    """Compared with the file as MuJoCo itself reads it, not with what the import says of it."""
    path, _ = model_file("gym ant")
    before = mujoco.MjModel.from_xml_path(str(path))
    write_folder(tmp_path / "mine", import_model(path))
    after = load_creature(tmp_path / "mine").model
    np.testing.assert_allclose(after.body_mass[1:], before.body_mass[1:], rtol=1e-5)
    np.testing.assert_allclose(after.body_inertia[1:], before.body_inertia[1:], rtol=1e-5)
    np.testing.assert_allclose(after.body_pos[2:], before.body_pos[2:], atol=1e-6)
    np.testing.assert_allclose(after.jnt_axis[1:], before.jnt_axis[1:], atol=1e-6)
    np.testing.assert_allclose(after.jnt_pos[1:], before.jnt_pos[1:], atol=1e-6)


@pytest.mark.parametrize(
    "name", ["laikago", *(pytest.param(name, marks=MORE) for name in ("mini cheetah", "solo12"))]
)
def test_a_stance_that_was_searched_has_no_foot_within_the_hips(tmp_path: Path, name: str):
    """Legs tucked in or crossed under the trunk stand, but whatever steps from there tips over."""
    write_folder(tmp_path / "mine", imported_model(name))
    creature = load_creature(tmp_path / "mine")
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.stand_qpos
    mujoco.mj_kinematics(creature.model, data)
    left = creature.frame.stand_rot @ creature.frame.left
    for geom in creature.feet.stepping:
        bodies = ancestors(creature.model, int(creature.model.geom_bodyid[geom]))
        hips = [
            data.xanchor[j] @ left
            for j in range(1, creature.model.njnt)
            if creature.model.jnt_bodyid[j] in bodies
        ]
        hip = max(hips, key=abs)
        assert (
            data.geom_xpos[geom] @ left * np.sign(hip) > abs(hip) - 0.03 * creature.frame.hip_height
        )


DOGS = ("unitree a1", "unitree go2", "laikago", "mini cheetah", "solo12", "anymal b")


@pytest.mark.thorough("each of them is imported, and test_inputs.py compares topologies")
def test_robot_dogs_share_one_program():
    """Twelve joints each, whatever rotors, sensors and shapes their files have."""

    def topology(name: str) -> Topology:
        creature = creature_of(imported_model(name).files)
        known = (creature.evolution_model, observation_layout(creature), find_crossings(creature))
        return lane_major_plant(*known, padded=True).topology

    first, *others = (topology(name) for name in DOGS)
    for name, other in zip(DOGS[1:], others, strict=True):
        assert difference(first, other) == "", name
