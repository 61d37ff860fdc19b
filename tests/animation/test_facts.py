"""What an exported file states about its walk, in numbers and in words."""

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pygltflib as gltf
import pytest
from helpers import made_up_certificate
from rendering.made_up import treading

from mjxgait.animation.export import (
    WalkLoop,
    build_clips,
    build_glb,
    examined,
    standing_still,
    stride_in_phase,
    walk_take,
)
from mjxgait.animation.export.facts import facts_of, measured_facts
from mjxgait.animation.export.footfalls import stances_once
from mjxgait.creature import Creature
from mjxgait.rendering.walk import Walk, record_walk
from mjxgait.training.folder import CERTIFICATE, open_champion

STORED = Path(__file__).parents[2] / "docs" / "data" / "walk"


@pytest.fixture(scope="module")
def walk(stool: Creature) -> Walk:
    return record_walk(stool, treading(stool, degrees=35.0), 4.0)


@pytest.fixture(scope="module")
def stride(walk: Walk) -> WalkLoop:
    return stride_in_phase(walk, 60)


def animations(data: bytes) -> list[gltf.Animation]:
    return gltf.GLTF2.load_from_bytes(data).animations


def test_engines_loop_the_walk_by_its_name(walk: Walk, stride: WalkLoop):
    assert [each.name for each in animations(build_glb(stride))] == ["walk-loop"]
    assert [each.name for each in animations(build_glb(walk_take(walk)))] == ["walk"]


def test_gait_and_duty_factor_are_those_of_the_certificate():
    report = json.loads((STORED / CERTIFICATE).read_text())["report"]
    loop = stride_in_phase(record_walk(*open_champion(STORED), 6.0), 60)
    facts = measured_facts(loop, False, loop.walk.creature.feet.names)
    assert facts["gait"] == report["gait"] == "trot"
    assert facts["duty_factor"] == pytest.approx(
        np.mean([*report["duty_factor"].values()]), abs=0.02
    )


def test_a_motion_that_is_no_loop_has_neither_gait_nor_footfalls(stride: WalkLoop):
    loops = {"idle": standing_still(stride), "walk-loop": stride}
    still, walks = animations(build_clips(loops))
    measured = {"gait", "duty_factor"}
    assert not measured & {*still.extras}
    assert measured < {*walks.extras}
    assert not still.extras.get("contacts")
    assert {fall["foot"] for fall in walks.extras["contacts"]} <= {*stride.walk.creature.feet.names}
    assert len(walks.extras["contacts"]) >= 4


def test_the_certificate_is_stated_only_if_it_is_known(stride: WalkLoop):
    assert "certificate" not in facts_of(stride, False)
    known = dataclasses.replace(stride, certificate="certified, margin 0.24")
    assert facts_of(known, False)["certificate"] == "certified, margin 0.24"


def test_the_certificate_in_words(stool_run: Path, walk: Walk, tmp_path: Path):
    run = shutil.copytree(stool_run, tmp_path / "run")
    assert examined(run, walk) == "not examined"
    assert examined(run, dataclasses.replace(walk, fell=1.44)) == "not certified: falls after 1.4 s"
    own = walk.champion.fingerprint
    for document, said in (
        (made_up_certificate(own), "certified, margin 0.50"),
        (made_up_certificate(own, (7, "slip")), "not certified: fails slip"),
        (made_up_certificate("another"), "not certified: its certificate is outdated"),
        ([], "not certified: its certificate cannot be read"),
    ):
        (run / CERTIFICATE).write_text(json.dumps(document))
        assert examined(run, walk) == said


def test_stances_end_with_a_motion_that_does_not_repeat():
    air, floor = [False], [True]
    assert stances_once(np.array(3 * floor + 6 * air + 4 * floor), 2) == [(0, 3), (9, 13)]
    assert stances_once(np.array(5 * floor + air + 5 * floor + 6 * air), 3) == [(0, 11)]
    assert stances_once(np.array(6 * air + floor + 8 * air), 3) == []
    assert stances_once(np.array(7 * floor), 3) == [(0, 7)]
