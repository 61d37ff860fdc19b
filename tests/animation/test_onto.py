"""A walk on the user's own character: its skin moves as the simulated body, and nothing else."""

import dataclasses
import json
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from animation import test_glb
from animation.skinned import PICTURE, frames_of, parts, skin_at, styled, transform, treading_loop
from animation.test_glb import read
from importer.rigs import DOG, bvh, glb
from scipy.spatial.transform import Rotation

from mjxgait.animation.export import WalkLoop, export_onto, read_character, standing_still
from mjxgait.animation.export.footfalls import footfalls, stances
from mjxgait.animation.export.onto import build_onto
from mjxgait.animation.keys import bring
from mjxgait.creature.load import creature_of
from mjxgait.experiments.repertoire.clips import CLIPS, TABLE, write_clips
from mjxgait.importer import ImportChoices, import_model

validate = test_glb.validate  # the fixture
ARMATURES = {
    "in centimetres": transform(size=0.01),
    "turned": transform((1.5, 0.0, -0.4), Rotation.from_euler("y", 90, degrees=True), 0.01),
    "of metres": transform(size=0.01),
}
"""Transform of the armature above bones in cm; the turned character looks along +X."""
BY_MATRIX = {"in centimetres": (), "turned": ("Armature", "Hips", "LeftShin"), "of metres": ()}


@dataclasses.dataclass(frozen=True, eq=False)
class Case:
    """A character, its creature's walk, and the way in m from the character's axes to the scene."""

    file: Path
    loop: WalkLoop
    scene: np.ndarray


@pytest.fixture(scope="module", params=[*ARMATURES])
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    armature = ARMATURES[request.param]
    file = tmp_path_factory.mktemp("onto") / "dog.glb"
    data = glb(soles=True)
    file.write_bytes(styled(data, armature, BY_MATRIX[request.param]))
    height = 1.2 if request.param == "of metres" else None
    files = import_model(file, ImportChoices(apart=False, height=height)).files
    loop = treading_loop(creature_of(files))
    return Case(file, loop, armature @ np.diag([100.0, 100.0, 100.0, 1.0]))


def written(case: Case, travelling: bool = False) -> tuple[gltf.GLTF2, str]:
    names, data = build_onto({"walk-loop": case.loop}, read_character(case.file), travelling)
    return gltf.GLTF2.load_from_bytes(data), names["walk-loop"]


def seen(case: Case, document: gltf.GLTF2, name: str) -> np.ndarray:
    """Vertices [F, V, 3] m, in the character's own axes."""
    back = np.linalg.inv(case.scene)
    shown = np.array([skin_at(document, poses) for poses in frames_of(document, name)])
    return shown @ back[:3, :3].T + back[:3, 3]


def bones_of_vertices(document: gltf.GLTF2) -> np.ndarray:
    """Name [V] of the bone that each vertex follows."""
    part = document.meshes[0].primitives[0]
    joints = read(document, part.attributes.JOINTS_0)[:, 0]
    return np.array([document.nodes[document.skins[0].joints[j]].name for j in joints])


@dataclasses.dataclass(frozen=True, eq=False)
class Body:
    """The simulated body by MuJoCo alone, in the character's own axes.

    way: [3, 3] from the world. unit: m of the character per m of the body. middle: [3] of the loop.
    """

    case: Case

    @cached_property
    def data(self) -> mujoco.MjData:
        return mujoco.MjData(self.case.loop.walk.creature.model)

    def poses(self, qpos: np.ndarray, part: str) -> tuple[np.ndarray, np.ndarray]:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.case.loop.walk.creature.model, self.data)
        return self.data.body(part).xpos.copy(), self.data.body(part).xmat.reshape(3, 3).copy()

    @cached_property
    def way(self) -> np.ndarray:
        ahead = np.append(self.case.loop.walk.forward, 0.0)
        return np.stack([np.cross([0.0, 0.0, 1.0], ahead), [0.0, 0.0, 1.0], ahead])

    @cached_property
    def unit(self) -> float:
        hips = 0.01 * np.subtract(DOG["Head"][1], DOG["Hips"][1])
        rest = self.case.loop.walk.creature.rest_qpos
        own = self.poses(rest, "Head")[0] - self.poses(rest, "Hips")[0]
        return float(np.linalg.norm(hips) / np.linalg.norm(own))

    def lowest(self, qpos: np.ndarray, *parts: str) -> np.ndarray:
        """Lowest point [3] m of the feet of these parts, which are balls and capsules."""
        creature = self.case.loop.walk.creature
        data = mujoco.MjData(creature.model)
        data.qpos[:] = qpos
        mujoco.mj_kinematics(creature.model, data)
        found = []
        for geom in creature.feet.stepping:
            if creature.model.body(creature.model.geom_bodyid[geom]).name in parts:
                radius, half, _ = creature.model.geom_size[geom]
                ends = half * data.geom_xmat[geom].reshape(3, 3)[:, 2]
                found += [data.geom_xpos[geom] + s * ends - [0, 0, radius] for s in (-1, 1)]
        return min(found, key=lambda point: point[2])

    @cached_property
    def floor(self) -> float:
        """Height of the lowest foot at rest, m of the character."""
        rest = self.case.loop.walk.creature.rest_qpos
        low = self.lowest(rest, *DOG)
        drop = self.poses(rest, "Hips")[0][2] - low[2]
        return 0.01 * DOG["Hips"][1][1] - self.unit * drop

    def moved(self, points: np.ndarray, part: str, frame: int, gone: float = 0.0) -> np.ndarray:
        """Places [V, 3] of points [V, 3] of a part that are at rest there, in a frame."""
        loop = self.case.loop
        place, turn = self.poses(loop.qpos[frame], part)
        _, still = self.poses(loop.walk.creature.rest_qpos, part)
        away = (points - 0.01 * np.array(DOG[part][1])) / self.unit
        own = away @ self.way @ still  # into the axes of the part
        world = place + own @ turn.T + gone * np.append(loop.walk.forward, 0.0)
        hips = 0.01 * np.array([0.0, 0.0, DOG["Hips"][1][2]])
        return self.unit * world @ self.way.T + hips + [0.0, self.floor, 0.0]


@pytest.mark.parametrize("travelling", [False, True])
def test_each_vertex_moves_as_the_simulated_body(case: Case, travelling: bool):
    document, name = written(case, travelling)
    vertices, body, bones = seen(case, document, name), Body(case), bones_of_vertices(document)
    rest = read(document, document.meshes[0].primitives[0].attributes.POSITION)
    hip = case.loop.walk.creature.frame.hip_height * body.unit
    off = np.zeros_like(vertices)
    for frame, shown in enumerate(vertices):
        gone = travelling * case.loop.advance * frame / (len(vertices) - 1)
        for part in DOG:
            own = bones == part
            off[frame, own] = shown[own] - body.moved(rest[own], part, frame, gone)
    off[..., 1] -= np.median(off[..., 1])  # raised as a whole, until the paws are on the floor
    on_legs = np.array([name.startswith(("Left", "Right")) for name in bones])
    assert np.abs(off[:, ~on_legs]).max() < 0.001 * hip
    assert np.abs(off).max() < 0.005 * hip
    moved = np.ptp(vertices, axis=0).max(0)
    assert (moved > 0.02 * hip).any(), "the walk moves"


def test_feet_stand_on_the_floor_and_slide_no_more_than_the_bodys(case: Case):
    document, name = written(case, travelling=True)
    vertices, body, bones = seen(case, document, name), Body(case), bones_of_vertices(document)
    hip = case.loop.walk.creature.frame.hip_height * body.unit
    count = len(vertices) - 1
    animation = next(each for each in document.animations if each.name == name)
    assert {fall["foot"] for fall in animation.extras["contacts"]} == {
        "LeftHand", "RightHand", "LeftHindPaw", "RightHindPaw"
    }  # fmt: skip
    for fall in animation.extras["contacts"]:
        own = np.flatnonzero(bones == fall["foot"])
        first, last = (int(np.ceil(case.loop.rate * fall["down"])), case.loop.rate * fall["up"])
        slid = np.zeros(2)
        for frame in range(first, int(last)):
            here = vertices[frame % count, own]
            low = here[:, 1].argmin()
            height = body.unit * body.lowest(case.loop.qpos[frame % count], fall["foot"])[2]
            assert abs(here[low, 1] - height) < 0.01 * hip
            assert abs(height) < 0.02 * hip  # it sinks in, or leaves for a moment
            if frame + 1 <= last and frame % count + 1 <= count:
                after = vertices[frame % count + 1, own[low]]
                slid[0] += np.linalg.norm((after - here[low])[[0, 2]])
                slid[1] += simulated_slide(body, fall["foot"], frame % count)
        assert slid[0] <= slid[1] + 0.01 * hip


def simulated_slide(body: Body, part: str, frame: int) -> float:
    """Way along the floor of the lowest point of a simulated foot to the next frame."""
    loop = body.case.loop
    low = body.lowest(loop.qpos[frame], part)
    (at, turn), (later, turned) = (body.poses(loop.qpos[f], part) for f in (frame, frame + 1))
    after = later + turned @ turn.T @ (low - at)
    step = loop.advance / (len(loop.qpos) - 1)
    return body.unit * float(np.linalg.norm((after - low)[:2] + step * loop.walk.forward))


@pytest.mark.parametrize("travelling", [False, True])
def test_the_validator_finds_nothing_that_was_not_in_the_file(
    case: Case, validate: Callable[[Path], dict[str, Any]], tmp_path: Path, travelling: bool
):
    out, plain = tmp_path / "walk.glb", tmp_path / "plain.glb"
    export_onto(case.loop, read_character(case.file), out, travelling)
    assert seen_by(validate(out)) == seen_by(validate(case.file))
    plain.write_bytes(glb(soles=True))
    export_onto(case.loop, read_character(plain), out, travelling)
    assert [validate(file)["numErrors"] for file in (plain, out)] == [0, 0]


def seen_by(issues: dict[str, Any]) -> list[tuple[str, str]]:
    """Code and place of each error and warning."""
    return sorted((m["code"], m["pointer"]) for m in issues["messages"] if m["severity"] < 2)


def test_all_of_the_file_stays_and_the_animation_follows(case: Case):
    before, blob = parts(case.file.read_bytes())
    _, data = build_onto({"walk-loop": case.loop}, read_character(case.file))
    after, longer = parts(data)
    assert longer.startswith(blob)
    assert PICTURE in longer
    assert after["buffers"] == [{"byteLength": len(longer)}]
    for key in set(before) - {"nodes", "buffers", "bufferViews", "accessors", "animations"}:
        assert after[key] == before[key], key
    for key in ("bufferViews", "accessors"):
        assert after[key][: len(before[key])] == before[key]
    assert set(after) - set(before) == {"animations"}
    changed = [
        one for one, other in zip(before["nodes"], after["nodes"], strict=True) if one != other
    ]
    assert all("matrix" in node for node in changed)
    ends = [view["byteOffset"] + view["byteLength"] for view in after["bufferViews"]]
    assert max(ends) <= len(longer)


@pytest.mark.parametrize("travelling", [False, True])
def test_bones_without_a_part_rest_against_their_parents(case: Case, travelling: bool):
    """Travelling, the bone on the floor carries the others, as engines expect."""
    document, name = written(case, travelling)
    animation = next(each for each in document.animations if each.name == name)
    moved: dict[str, set[str]] = {}
    for channel in animation.channels:
        node = document.nodes[channel.target.node].name
        moved.setdefault(node, set()).add(channel.target.path)
    assert moved.pop("Hips") == {"translation", "rotation"}
    if travelling:
        assert "translation" in moved.pop("root")
    assert all(paths == {"rotation"} for paths in moved.values())
    assert set(moved) < set(DOG)
    assert not {"Neck", "Tail", "Head"} & set(moved)  # rigid parts
    first, last = (frames_of(document, name)[frame] for frame in (0, -1))
    place = [node.name for node in document.nodes].index
    own = [np.linalg.inv(poses[place("Neck")]) @ poses[place("collar")] for poses in (first, last)]
    assert own[0] == pytest.approx(own[1], abs=1e-5)
    gone = last[place("root")][:3, 3] - first[place("root")][:3, 3]
    ahead = case.loop.advance * Body(case).unit * case.scene[:3, 2]
    assert gone == pytest.approx(travelling * ahead, abs=1e-5)


def test_the_loop_is_named_for_engines_and_takes_no_name_twice(case: Case, tmp_path: Path):
    out = tmp_path / "walk.glb"
    assert export_onto(case.loop, read_character(case.file), out) == "walk-loop"
    again = tmp_path / "again.glb"
    assert export_onto(case.loop, read_character(out), again) == "walk_2-loop"
    names = [each.name for each in gltf.GLTF2.load_from_bytes(again.read_bytes()).animations]
    assert names == ["walk-loop", "walk_2-loop"]


def test_a_character_twice_as_large_takes_longer_steps(case: Case, tmp_path: Path):
    """And one that its program has turned: what counts is its skeleton."""
    file = tmp_path / "large.glb"
    armature = transform((0, 1, 0), Rotation.from_euler("xyz", [-90, 20, 0], degrees=True), 0.02)
    file.write_bytes(styled(glb(soles=True), armature))
    document, name = written(dataclasses.replace(case, file=file), travelling=True)
    large = dataclasses.replace(case, file=file, scene=armature @ np.diag([100.0] * 3 + [1.0]))
    plain, other = written(case, travelling=True)
    small = seen(case, plain, other)
    assert seen(large, document, name) == pytest.approx(small, abs=1e-4)
    speeds = [d.animations[-1].extras["speed_m_per_s"] for d in (document, plain)]
    assert speeds[0] == pytest.approx(2 * speeds[1])


@pytest.fixture(scope="module")
def loop_of_bvh(tmp_path_factory: pytest.TempPathFactory) -> WalkLoop:
    file = tmp_path_factory.mktemp("skeleton") / "dog.bvh"
    file.write_text(bvh())
    return treading_loop(creature_of(import_model(file, ImportChoices(apart=False)).files))


def test_a_skeleton_of_bvh_walks_on_the_same_character(case: Case, loop_of_bvh: WalkLoop):
    other = dataclasses.replace(case, loop=loop_of_bvh)
    document, name = written(other)
    assert np.ptp(seen(other, document, name), axis=0).max() > 0.01


def test_reading_it_back_gives_the_same_angles(case: Case, tmp_path: Path):
    creature, out = case.loop.walk.creature, tmp_path / "walk.glb"
    export_onto(case.loop, read_character(case.file), out)
    brought = bring(creature, out, tolerance=np.radians(90.0))
    angles = case.loop.qpos[:, creature.joints.qpos_adr]
    # A knee bends a little more where the simulated paw sinks in.
    assert brought.track.angles == pytest.approx(angles, abs=np.radians(1.5))


def test_stances_are_counted_across_the_seam():
    air, floor = [False], [True]
    assert stances(np.array(4 * air + 6 * floor + 5 * air), 2) == [(4, 10)]
    assert stances(np.array(3 * floor + 6 * air + 4 * floor), 2) == [(9, 16)]
    assert stances(np.array(5 * floor + air + 5 * floor + 6 * air), 3) == [(0, 11)]
    assert stances(np.array(6 * air + floor + 8 * air), 3) == []
    assert stances(np.array(7 * floor), 3) == [(0, 7)]


def test_footfalls_are_where_the_feet_are_down(case: Case):
    """By the lowest point of the simulated feet alone."""
    loop = case.loop
    height = loop.walk.recording.foot_height[loop.frames[0] : loop.frames[1]]
    step = loop.times[-1] / len(height)
    hip = loop.walk.creature.frame.hip_height
    falls = footfalls(loop)
    assert falls == sorted(falls, key=lambda fall: (fall.down, fall.foot))
    for fall in falls:
        assert 0 <= fall.down < loop.times[-1]
        frames = np.arange(round(fall.down / step), round(fall.up / step)) % len(height)
        assert np.median(height[frames, fall.foot]) < 0.01 * hip


def test_a_repertoire_is_written_onto_the_character(case: Case, tmp_path: Path):
    """All clips move the same bones; each shows what it shows alone, with one height for all."""
    before = tmp_path / "before.glb"
    export_onto(case.loop, read_character(case.file), before)  # so that a name is taken
    loops = {"idle": standing_still(case.loop), "walk": case.loop}
    files = tmp_path / CLIPS, tmp_path / TABLE
    write_clips(*files, loops, [], [], [], [], False, read_character(before))
    document = gltf.GLTF2.load_from_bytes(files[0].read_bytes())
    first, idle, walk = document.animations
    assert [first.name, idle.name, walk.name] == ["walk-loop", "idle", "walk_2-loop"]
    table = json.loads(files[1].read_text())
    assert [clip["animation"] for clip in table["clips"]] == ["idle", "walk_2-loop"]
    idles, walks = (
        {(channel.target.node, channel.target.path) for channel in clip.channels}
        for clip in (idle, walk)
    )
    assert idles == walks
    alone, again = (seen(case, document, name) for name in ("walk-loop", "walk_2-loop"))
    off = again - alone
    off[..., 1] -= np.median(off[..., 1])
    assert np.abs(off).max() < 0.005 * case.loop.walk.creature.frame.hip_height * Body(case).unit
    assert np.ptp(seen(case, document, "idle"), axis=0).max() < 1e-6
    assert PICTURE in files[0].read_bytes()
