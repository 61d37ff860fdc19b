"""The table beside a character's file speaks of that file: its metres, bones and animations."""

import dataclasses
import json
from pathlib import Path

import mujoco
import numpy as np
import pygltflib as gltf
import pytest
from animation.skinned import styled, transform
from importer.rigs import glb
from rendering.made_up import treading

from mjxgait.animation.export import WalkLoop, read_character, standing_still, stride_in_phase
from mjxgait.creature.load import creature_of
from mjxgait.experiments.repertoire.clips import CLIPS, IDLE, TABLE, Transition, write_clips
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.grid import Cell
from mjxgait.importer import ImportChoices, import_model
from mjxgait.rendering.walk import record_walk

HEIGHT = 1.2
"""m, of the creature; the character is in other units."""
CELL, MISSED = Cell(0.2, 0.0), Cell(0.4, 0.0)
WAY = 0.3
"""m, of a start."""


def written(folder: Path, size: float) -> tuple[dict, gltf.GLTF2, WalkLoop]:
    """Table and file of one walk on a character of this scale, and the walk itself."""
    file = folder / "dog.glb"
    file.write_bytes(styled(glb(soles=True), transform(size=size), ()))
    files = import_model(file, ImportChoices(apart=False, height=HEIGHT)).files
    creature = creature_of(files)
    loop = stride_in_phase(record_walk(creature, treading(creature, degrees=5.0), 4.0), 30)
    found = [
        Found(CELL, True, 0.2, 0.0, 0.6, "trot", 0.3, ()),
        Found(MISSED, False, 0.2, 0.0, 0.6, "trot", -0.3, ("progress",)),
    ]
    path = np.array([[0.0, 0.0], WAY * loop.walk.forward])
    begins = dataclasses.replace(
        loop, qpos=loop.qpos[:2], strides=0, advance=0.0, path=path, frames=(0, 200)
    )
    ways = [Transition(IDLE, CELL.name, begins)]
    loops = {IDLE: standing_still(loop), CELL.name: loop}
    files_of = folder / CLIPS, folder / TABLE
    write_clips(*files_of, loops, found, [], [], ways, False, read_character(file))
    document = gltf.GLTF2.load_from_bytes(files_of[0].read_bytes())
    return json.loads(files_of[1].read_text()), document, loop


@pytest.mark.parametrize("size", [0.01, 0.03], ids=["small", "large"])
def test_the_table_counts_in_the_metres_of_the_file(tmp_path: Path, size: float):
    """An engine takes a unit of the file for a metre: in it the character's size is the file's."""
    table, document, loop = written(tmp_path, size)
    tall = {"of the file": 64 * size, "of the creature": creature_height(loop)}
    scale = tall["of the file"] / tall["of the creature"]
    assert abs(scale - 1) > 0.2
    assert table["scale"] == pytest.approx(scale, rel=0.02)
    idle, walk = table["clips"]
    assert (idle["speed"], walk["speed"]) == (0, pytest.approx(scale * loop.speed, rel=0.02))
    own = next(each for each in document.animations if each.name == walk["animation"])
    assert walk["speed"] == pytest.approx(own.extras["speed_m_per_s"], rel=1e-2)
    assert walk["asked"] == {"speed": pytest.approx(scale * CELL.speed, rel=0.02), "turn": 0.0}
    assert table["not_certified"][0]["speed"] == pytest.approx(scale * MISSED.speed, rel=0.02)
    (start,) = table["transitions"]
    assert start["way"] == pytest.approx(scale * WAY, rel=0.02)
    assert {"speed": "m/s", "way": "m"}.items() <= table["units"].items()


def creature_height(loop: WalkLoop) -> float:
    """Height of the head's bone above the floor at rest, m."""
    creature = loop.walk.creature
    data = mujoco.MjData(creature.model)
    data.qpos[:] = creature.rest_qpos
    mujoco.mj_kinematics(creature.model, data)
    return float(data.body("Head").xpos[2])


def test_feet_are_bones_of_the_character(tmp_path: Path):
    """Of clips and of starts, as the file itself names them."""
    table, document, _ = written(tmp_path, 0.01)
    walk, (start,) = table["clips"][1], table["transitions"]
    own = next(each for each in document.animations if each.name == walk["animation"])
    assert walk["contacts"] == own.extras["contacts"] != []
    assert {fall["foot"] for fall in start["contacts"]} <= {
        fall["foot"] for fall in walk["contacts"]
    }
    assert len(start["contacts"]) >= 4
