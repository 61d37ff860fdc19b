"""Odd characters, from their file to a walk on it: names, units, A-poses, turned and far roots."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path

import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from animation.skinned import frames_of, parts, treading_loop, whole
from importer.hostile_rigs import ODD, changed
from importer.rigs import Bone, glb
from importer.test_arms import FIGURE
from scipy.spatial.transform import Rotation

from mjxgait.animation.clips.clip import written
from mjxgait.animation.export import WalkLoop, build_onto, read_character
from mjxgait.creature import Creature
from mjxgait.creature.load import creature_of
from mjxgait.errors import UserError
from mjxgait.importer import ImportChoices, import_model

ONE_NAME = ("the same name for all", "no names")
LYING = "a root on its side"
"""Its dog stands on its nose, and so it has two feet."""
HALF = float(np.sqrt(0.5))


def lowered(bones: Mapping[str, Bone], degrees: float = 45.0) -> dict[str, Bone]:
    """A figure with spread arms that point down by so many degrees: an A-pose."""
    low = np.radians(degrees)

    def at(place: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = place
        side, away = np.sign(x), abs(x) - 18.0
        return (float(side * (18.0 + away * np.cos(low))), float(y - away * np.sin(low)), z)

    arms = ("Forearm", "Hand")
    return {
        name: (parent, at(place), end and at(end)) if name[1:] in arms else (parent, place, end)
        for name, (parent, place, end) in bones.items()
    }


def as_of_mixamo() -> bytes:
    """A person in A-pose, with Mixamo's names, in centimetres below a turned root."""
    description, blob = parts(glb(lowered(FIGURE)))
    for node in description["nodes"]:
        if node["name"] == "Armature":
            node["rotation"] = Rotation.from_euler("y", 90, degrees=True).as_quat().tolist()
        node["name"] = f"mixamorig:{node['name']}"
    return whole(description, blob)


FILES: Mapping[str, Callable[[], bytes]] = {
    **{
        name: (lambda change=change: changed(change))
        for name, change in ODD.items()
        if name not in (*ONE_NAME, LYING)
    },
    "a person in A-pose as of Mixamo": as_of_mixamo,
}
"""Their bytes, made when a test needs them."""


@dataclasses.dataclass(frozen=True, eq=False)
class Places:
    """Places [F, B, 3] of a creature's parts: of the simulated bodies in m, and of their bones."""

    bodies: np.ndarray
    bones: np.ndarray

    def off(self) -> np.ndarray:
        """Largest distance [B] in m of each part, after the best rotation, scale and shift of all."""
        own, other = (
            p.reshape(-1, 3) - p.reshape(-1, 3).mean(0) for p in (self.bodies, self.bones)
        )
        factor = np.sqrt((other**2).sum() / (own**2).sum())
        turn, _ = Rotation.align_vectors(own, other / factor)
        away = np.linalg.norm(own - turn.apply(other / factor), axis=1)
        worst: np.ndarray = away.reshape(self.bodies.shape[:2]).max(0)
        return worst


def places_in(file: Path, loop: WalkLoop) -> Places:
    names, data = build_onto({"walk": loop}, read_character(file))
    document, creature = gltf.GLTF2.load_from_bytes(data), loop.walk.creature
    bones = creature.settings.rig.bones
    called = {written(str(node.name)): i for i, node in enumerate(document.nodes)}
    shown = np.array(
        [
            [poses[called[bone]][:3, 3] for bone in bones.values()]
            for poses in frames_of(document, names["walk"])
        ]
    )
    return Places(np.array([bodies_of(creature, row) for row in loop.qpos]), shown)


def bodies_of(creature: Creature, qpos: np.ndarray) -> list[np.ndarray]:
    data = mujoco.MjData(creature.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(creature.model, data)
    return [data.body(part).xpos.copy() for part in creature.settings.rig.bones]


@pytest.mark.usefixtures("a_short_search")
@pytest.mark.parametrize("made", FILES.values(), ids=FILES)
def test_an_odd_character_moves_as_its_simulated_body(made: Callable[[], bytes], tmp_path: Path):
    file = tmp_path / "character.glb"
    file.write_bytes(made())
    creature = creature_of(import_model(file, ImportChoices(apart=False)).files)
    places = places_in(file, treading_loop(creature))
    assert np.ptp(places.bodies, axis=0).max() > 0.03 * creature.frame.hip_height
    off = places.off() / creature.frame.hip_height
    assert np.median(off) < 0.01
    assert off.max() < 0.05  # a knee may bend more, for its foot


def test_arms_of_an_a_pose_hang_in_its_walk(tmp_path: Path):
    file = tmp_path / "person.glb"
    file.write_bytes(as_of_mixamo())
    creature = creature_of(import_model(file, ImportChoices(apart=False)).files)
    assert set(creature.settings.rig.turned) == {"LArm", "RArm"}
    character = read_character(file)
    _, data = build_onto({"walk": treading_loop(creature)}, character)
    document = gltf.GLTF2.load_from_bytes(data)
    place = {node.name: i for i, node in enumerate(document.nodes)}
    arm, hand = (place[f"mixamorig:L{part}"] for part in ("Arm", "Hand"))
    rest = character.world[hand, 1, 3] - character.world[arm, 1, 3]
    assert rest == pytest.approx(-0.54 * HALF, abs=1e-3), "45 degrees"
    for poses in frames_of(document, "walk"):
        assert poses[hand][1, 3] - poses[arm][1, 3] < -0.45


@pytest.mark.parametrize("name", ONE_NAME)
def test_bones_that_share_a_name_are_one_sentence(name: str, tmp_path: Path):
    file = tmp_path / "dog.glb"
    file.write_bytes(changed(ODD[name]))
    creature = creature_of(import_model(file, ImportChoices(apart=False)).files)
    with pytest.raises(UserError, match="has several bones called") as raised:
        build_onto({"walk": treading_loop(creature)}, read_character(file))
    assert "\n" not in str(raised.value)


def test_bones_without_a_skin_are_one_sentence(tmp_path: Path):
    file = tmp_path / "dog.glb"
    description, blob = parts(glb())
    del description["skins"], description["nodes"][-1]["skin"]
    file.write_bytes(whole(description, blob))
    way_out = "has no skin, which says what its bones are; export the armature with its mesh"
    for read in (read_character, import_model):
        with pytest.raises(UserError, match=way_out) as raised:
            read(file)
        assert str(raised.value).startswith(str(file))
        assert "\n" not in str(raised.value)
