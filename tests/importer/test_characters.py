"""Characters as game artists make them: bellies that hang low, wings, flat parts, many clips."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from animation.skinned import parts, whole
from importer.rigs import DOG, Bone, bvh, glb

from mjxgait.animation.clips.read_glb import rig_of_glb
from mjxgait.animation.clips.read_text import rig_of_bvh
from mjxgait.certification.check_body import check_body
from mjxgait.creature.load import creature_of
from mjxgait.importer import ImportChoices, import_model
from mjxgait.importer.rig import Plan
from mjxgait.importer.rig_hinges import hinges_of
from mjxgait.importer.rig_radii import narrow_radius, round_radius
from mjxgait.tasks.walk.targets import WalkTargets, configured

LOW: dict[str, Bone] = {
    "Belly": ("Hips", (0, 45, -20), None),
    "BellyTip": ("Belly", (0, 30, -15), (0, 1, -12)),
    "Tail": ("Hips", (0, 50, -34), (0, 1, -78)),
}
"""A belly and a tail that end at the floor, in the middle."""


def sided(bones: Mapping[str, Bone]) -> dict[str, Bone]:
    """The same bones on the left, where they are, and on the right."""

    def at(point: tuple[float, float, float] | None, sign: int):
        return point and (sign * point[0], *point[1:])

    return {
        side + name: (side + parent if parent in bones else parent, at(place, sign), at(end, sign))
        for side, sign in (("L", 1), ("R", -1))
        for name, (parent, place, end) in bones.items()
    }


BIRD = {
    "Hips": ("", (0, 50, -8), None),
    "Chest": ("Hips", (0, 50, 30), None),
    "Head": ("Chest", (0, 57, 60), (0, 55, 90)),
    **sided(
        {
            "Wing": ("Chest", (10, 50, 30), None),
            "Hand": ("Wing", (130, 66, 24), (290, 63, 0)),
            "Thigh": ("Hips", (2, 45, -16), None),
            "Shin": ("Thigh", (12, 38, -10), None),
            "Ankle": ("Shin", (12, 23, -22), None),
            "Foot": ("Ankle", (12, 3, -6), (12, 1, 10)),
        }
    ),
}
"""Its thighs begin beside the middle, and its wings are far longer than its legs."""

REX = {
    "Hips": ("", (0, 95, 0), None),
    "Chest": ("Hips", (0, 100, 45), None),
    "Neck": ("Chest", (0, 120, 80), None),
    "Head": ("Neck", (0, 140, 160), (0, 135, 210)),
    "Tail": ("Hips", (0, 95, -10), (0, 90, -60)),
    **sided(
        {
            "Thigh": ("Hips", (20, 92, 0), None),
            "Shin": ("Thigh", (22, 58, 25), None),
            "Ankle": ("Shin", (22, 30, -5), None),
            "Foot": ("Ankle", (22, 8, 5), (22, 2, 35)),
        }
    ),
}
"""Far more of it is ahead of its feet than behind them."""


def test_a_body_with_a_heavy_head_stands_with_its_feet_beneath_it(tmp_path: Path):
    file = tmp_path / "rex.bvh"
    file.write_text(bvh(REX))
    assert import_model(file, ImportChoices(apart=False)).stands


def test_what_hangs_in_the_middle_is_no_foot(tmp_path: Path):
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(DOG | LOW))
    creature = creature_of(import_model(file, ImportChoices(apart=False)).files)
    feet = {name.removesuffix("_foot") for name in creature.feet.names}
    assert feet == {"LeftHand", "RightHand", "LeftHock", "RightHock"}
    # Without the tail, which ends at -0.78 m, and the head, which ends at 0.48 m.
    assert 0.44 < creature.frame.body_length < 0.75


def test_a_bird_has_legs_beside_its_wings(tmp_path: Path):
    file = tmp_path / "bird.bvh"
    file.write_text(bvh(BIRD))
    plan = Plan(1, rig_of_bvh(file))
    assert {plan.rig.names[bone] for bone in plan.limbs} == {"LWing", "RWing", "LThigh", "RThigh"}
    assert [plan.rig.names[bone] for bone in plan.feet] == ["LFoot", "RFoot"]
    found = dict(zip(plan.rig.names, hinges_of(plan), strict=True))
    assert [hinge.name for hinge in found["LThigh"]] == ["pitch", "roll"]
    assert [len(found[name]) for name in ("LShin", "LAnkle", "LFoot")] == [1, 1, 1]


@pytest.mark.parametrize("flat", [1.0, 0.01])
def test_a_wing_weighs_as_much_as_its_cross_section(flat: float):
    """A bar with the area of an ellipse with axes of 0.2 m and a share of that."""
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ring = 0.2 * np.stack([np.cos(turn), flat * np.sin(turn)], 1)
    points = np.concatenate([np.insert(ring, 2, z, axis=1) for z in (0.1, 0.5, 0.9)])
    ends = np.zeros(3), np.array([0.0, 0.0, 1.0])
    assert round_radius(points, *ends) == pytest.approx(0.2 * np.sqrt(flat))
    assert narrow_radius(points, *ends) == pytest.approx(0.2 * flat)


def test_legs_far_apart_get_the_strength_to_stand(tmp_path: Path):
    """A spider lies between its feet, which are far longer arms than its hips are high."""
    spider = {"Trunk": ("", (0, 30, -150), (0, 30, 150))} | sided(
        {
            f"{part}{row}": (parent and (parent if part == "A" else f"{parent}{row}"), place, end)
            for row, ahead in enumerate((-60, -20, 20, 60))
            for part, parent, place, end in (
                ("A", "Trunk", (20, 30, 0.6 * ahead), None),
                ("B", "A", (90, 75, 0.8 * ahead), None),
                ("C", "B", (160, 55, ahead), (220, 1, 1.2 * ahead)),
            )
        }
    )
    file = tmp_path / "spider.bvh"
    file.write_text(bvh(spider))
    made = import_model(file, ImportChoices(apart=False))
    assert made.stands
    assert "times as much, because it sank" in made.notes.text()


def test_a_file_with_many_clips_is_read_at_once(tmp_path: Path):
    """Games keep 80 animations in one file: ten thousands of parts in its description."""
    description, blob = parts(glb())
    channels = [{"sampler": i, "target": {"node": 0, "path": "scale"}} for i in range(120)]
    samplers = [{"input": 0, "output": 0}] * 120
    description["animations"] = [{"channels": channels, "samplers": samplers}] * 100
    assert json.dumps(description).count("{") > 30_000
    file = tmp_path / "dog.glb"
    file.write_bytes(whole(description, blob))
    assert set(DOG) <= set(rig_of_glb(file).names)


def test_a_foot_and_its_fixed_toes_are_one(tmp_path: Path):
    """Each toe is a part of its own, and touches the floor."""
    toe = {
        f"{side}{name}": (f"{side}HindPaw", (x * sign, 2, -27), (x * sign, 0, -20))
        for side, sign in (("Left", 1), ("Right", -1))
        for name, x in (("Inner", 6), ("Outer", 10))
    }
    file = tmp_path / "dog.glb"
    file.write_bytes(glb(DOG | toe))
    creature = creature_of(import_model(file, ImportChoices(apart=False)).files)
    touching = {creature.model.geom_bodyid[g] for g in creature.feet.stepping}
    assert len(touching) > len(creature.feet.names) == 4
    check_body(creature)


def test_a_character_on_four_feet_walks_as_an_animal(tmp_path: Path):
    """Evolution begins near that walk, unless another gait is given, or any."""
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(DOG))
    creature = creature_of(import_model(file, ImportChoices(apart=False)).files)
    usual = configured(creature, None, {}, WalkTargets())
    asked = configured(creature, None, {}, WalkTargets(gait="natural"))
    assert (usual.controller, usual.evolution) == (asked.controller, asked.evolution)
    assert usual.fitness.wish.gait == "walk"
    assert configured(creature, None, {}, WalkTargets(gait="auto")).fitness.wish.gait == "auto"


@pytest.mark.parametrize(("times", "narrow"), [(0.8, True), (3.0, False)])
def test_a_narrow_character_steps_under_a_fall(tmp_path: Path, times: float, narrow: bool):
    """Its feet land where it falls, but it stands, so it is evolved like others on four feet."""

    def at(point: tuple[float, float, float] | None):
        return point and (times * point[0], *point[1:])

    dog = {name: (parent, at(place), at(end)) for name, (parent, place, end) in DOG.items()}
    file = tmp_path / "dog.bvh"
    file.write_text(bvh(dog))
    made = import_model(file, ImportChoices(apart=False))
    creature = creature_of(made.files)
    assert (np.abs(creature.feet.places[:, 1]).mean() < 0.28 * creature.frame.hip_height) == narrow
    assert creature.corrections.steps == narrow
    assert ("feet land under a fall" in made.notes.text()) == narrow
    assert creature.settings.train["fitness"]["weights"]["patter"] > 0
    if narrow:
        weights = creature.corrections.stepping
        assert (np.abs(weights.aside) > 0).sum() == (np.abs(weights.ahead) > 0).sum() == 4
