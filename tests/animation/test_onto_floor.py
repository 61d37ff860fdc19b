"""A walk on a character with a skin that is no capsule: its feet are on the floor, by vertices."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from animation.skinned import frames_of, skin_at, treading_loop
from animation.test_glb import read
from importer.rigs import DOG, Bone, glb
from importer.test_arms import FIGURE

from mjxgait.animation.export import WalkLoop, build_onto, read_character
from mjxgait.creature.load import creature_of
from mjxgait.importer import ImportChoices, import_model

BEAR: dict[str, Bone] = {
    name: (parent, (1.5 * x, y, 0.8 * z), end and (1.5 * end[0], end[1], 0.8 * end[2]))
    for name, (parent, (x, y, z), end) in DOG.items()
}
"""Wider and shorter than the dog."""
HIGH: dict[str, Bone] = {
    name: (parent, (x, y + 300, z), end and (end[0], end[1] + 300, end[2]))
    for name, (parent, (x, y, z), end) in DOG.items()
}
"""A dog that is not at its origin."""


@dataclasses.dataclass(frozen=True)
class Drawn:
    """A character. feet: bones of each foot's skin. paws: m by which their soles are lower.

    floor: its height in m.
    """

    bones: Mapping[str, Bone]
    feet: tuple[tuple[str, ...], ...]
    paws: Mapping[str, float] = dataclasses.field(default_factory=dict)
    floor: float = 0.0


PAWS = (("LeftHand",), ("RightHand",), ("LeftHock", "LeftHindPaw"), ("RightHock", "RightHindPaw"))
DRAWN = {
    "dog": Drawn(DOG, PAWS),
    "dog far above its origin": Drawn(HIGH, PAWS, floor=3.02 - 0.03),
    "bear with thick forepaws": Drawn(BEAR, PAWS, {"LeftHand": 0.02, "RightHand": 0.02}),
    "person": Drawn(FIGURE, (("LFoot",), ("RFoot",))),
}
"""At rest the dog's paws are 2 % of its hip height below the origin, the bear's forepaws 7 %."""


@dataclasses.dataclass(frozen=True, eq=False)
class Shown:
    """A walk in the file. vertices: [F, V, 3] m in the scene. bones: [V] that each follows."""

    drawn: Drawn
    loop: WalkLoop
    file: Path
    vertices: np.ndarray
    bones: np.ndarray

    @property
    def hip(self) -> float:
        return float(self.loop.walk.creature.frame.hip_height)

    def soles(self) -> list[np.ndarray]:
        """Vertices [F, V, 3] of each foot."""
        return [self.vertices[:, np.isin(self.bones, foot)] for foot in self.drawn.feet]

    def lows(self) -> np.ndarray:
        """Heights [F, feet] of the lowest vertices above the floor."""
        return np.stack([sole[..., 1].min(1) for sole in self.soles()], 1) - self.drawn.floor


def shown_in(file: Path, loop: WalkLoop, drawn: Drawn) -> Shown:
    names, data = build_onto({"walk-loop": loop}, read_character(file), travelling=True)
    document = gltf.GLTF2.load_from_bytes(data)
    frames = frames_of(document, names["walk-loop"])
    vertices = np.array([skin_at(document, poses) for poses in frames])
    joints = read(document, document.meshes[0].primitives[0].attributes.JOINTS_0)[:, 0]
    bones = [document.nodes[document.skins[0].joints[joint]].name for joint in joints]
    return Shown(drawn, loop, file, vertices, np.array(bones))


@pytest.fixture(scope="module", params=[*DRAWN])
def shown(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    drawn = DRAWN[request.param]
    file = tmp_path_factory.mktemp("floor") / "character.glb"
    file.write_bytes(glb(drawn.bones, soles=True, paws=drawn.paws))
    creature = creature_of(import_model(file, ImportChoices(apart=False)).files)
    return shown_in(file, treading_loop(creature), drawn)


def simulated(loop: WalkLoop) -> tuple[np.ndarray, np.ndarray]:
    """Heights [F, feet] in m of the lowest points of the feet, which are balls and capsules.

    And how far [F - 1, feet] those points go along the floor to the next frame.
    """
    creature = loop.walk.creature
    model, feet = creature.model, creature.feet
    poses = []
    for row in loop.qpos:
        data = mujoco.MjData(model)
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        poses.append(data)
    step = loop.advance / (len(loop.qpos) - 1) * loop.walk.forward
    heights, slides = [], []
    for data, after in zip(poses, [*poses[1:], None], strict=True):
        lows = [low_of(data, model, feet.stepping, feet.foot_of, f) for f in range(len(feet.names))]
        heights.append([point[2] for point, _ in lows])
        if after is not None:
            slides.append([np.linalg.norm(gone(data, after, *low)[:2] + step) for low in lows])
    return np.array(heights), np.array(slides)


def low_of(data, model, geoms, foot_of, foot: int) -> tuple[np.ndarray, int]:
    """The lowest point of a foot, and its body."""
    found = []
    for geom, own in zip(geoms, foot_of, strict=True):
        radius, half, _ = model.geom_size[geom]
        ends = half * data.geom_xmat[geom].reshape(3, 3)[:, 2]
        points = [data.geom_xpos[geom] + sign * ends - [0, 0, radius] for sign in (-1, 1)]
        found += [(point, model.geom_bodyid[geom]) for point in points if own == foot]
    return min(found, key=lambda low: low[0][2])


def gone(data, after, point: np.ndarray, body: int) -> np.ndarray:
    """Way [3] of a point of a body between two poses."""
    own = data.xmat[body].reshape(3, 3).T @ (point - data.xpos[body])
    return after.xpos[body] + after.xmat[body].reshape(3, 3) @ own - point


def test_the_skin_stands_on_the_floor_where_the_simulated_feet_do(shown: Shown):
    """Within 1 % of the hip height of the floor, which is at the scene's origin if it can be."""
    heights, _ = simulated(shown.loop)
    lows, down = shown.lows() / shown.hip, heights / shown.hip
    assert (down < 0.005).any(0).all(), "each foot stands somewhere in the loop"
    assert np.abs(lows[down < 0.005]).max() < 0.01
    assert lows.min() > -0.01
    assert np.abs(lows - down).max() < 0.02


def test_soles_slide_no_more_than_the_simulated_feet(shown: Shown):
    """But for a few percent of the hip height, where a foot rolls on a sole that is thicker."""
    heights, slides = simulated(shown.loop)
    stands = np.maximum(heights[:-1], heights[1:]) < 0.01 * shown.hip
    for foot, sole in enumerate(shown.soles()):
        low = sole[..., 1].argmin(1)
        ways = [
            np.linalg.norm((after[i] - before[i])[[0, 2]])
            for before, after, i in zip(sole, sole[1:], low, strict=False)
        ]
        on = stands[:, foot]
        assert on.sum() > 2
        assert np.sum(ways, where=on) <= np.sum(slides[:, foot], where=on) + 0.025 * shown.hip
