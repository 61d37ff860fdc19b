"""Certified walks of a repertoire as clips of one file, and the table of their places."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.animation.export import (
    WalkLoop,
    build_clips,
    standing_still,
    stride_in_phase,
)
from mjxgait.experiments.repertoire.blends import Blend
from mjxgait.experiments.repertoire.changes import Change
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.transitions import IDLE, Transition
from mjxgait.files import write_bytes, write_text
from mjxgait.rendering.cast import LOOP_SECONDS, champion_of
from mjxgait.training.disk import disk_errors

SCHEMA = 1
CLIPS, TABLE = "repertoire.glb", "repertoire.json"


def clips_of(folder: Path, found: Sequence[Found], rate: int) -> dict[str, WalkLoop]:
    """Return a stride of each certified walk by name, all in phase, and the standing pose."""
    loops = {
        one.cell.name: stride_in_phase(champion_of(folder / one.cell.name, LOOP_SECONDS).walk, rate)
        for one in found
        if one.certified
    }
    return loops and {IDLE: standing_still(next(iter(loops.values()))), **loops}


def write_clips(
    file: Path,
    table: Path,
    loops: dict[str, WalkLoop],
    found: Sequence[Found],
    between: Sequence[Blend],
    changed: Sequence[Change],
    ways: Sequence[Transition],
    travelling: bool,
) -> None:
    """Write the GLB and the JSON beside it."""
    document = table_of(file.name, loops, found, travelling)
    document["blends"] = [blend.entry for blend in between]
    document["changes"] = [change.entry for change in changed]
    document["transitions"] = [way.entry for way in ways]
    clips = loops | {way.name: way.loop for way in ways if way.loop is not None}
    with disk_errors(file.parent):
        write_bytes(file, build_clips(clips, travelling))
        write_text(table, json.dumps(document, indent=2) + "\n")


def table_of(
    file: str, loops: dict[str, WalkLoop], found: Sequence[Found], travelling: bool
) -> dict[str, Any]:
    """Return the content of `repertoire.json`: each clip's place in a blend space."""
    walk = next(iter(loops.values())).walk
    by_name = {one.cell.name: one for one in found}
    clips = [_entry(name, loop, by_name.get(name)) for name, loop in loops.items()]
    return {
        "schema": SCHEMA,
        "creature": walk.creature.name,
        "file": file,
        "units": {"speed": "m/s", "turn": "deg/s, to the left", "duration": "s"},
        "root_motion": travelling,
        "begins": f"where {walk.creature.feet.names[0]} comes down",
        "clips": clips,
        "not_certified": [
            {"speed": one.cell.speed, "turn": one.cell.turn, "fails": list(one.fails)}
            for one in found
            if not one.certified
        ],
    }


def _entry(name: str, loop: WalkLoop, one: Found | None) -> dict[str, Any]:
    """Return a clip's entry. speed, turn: measured, for blending; asked: the cell's targets."""
    duration = float(loop.times[-1])
    entry: dict[str, Any] = {
        "name": name,
        "speed": round(loop.speed, 4),
        "turn": round(float(np.degrees(loop.turned)) / duration, 3),
        "duration": round(duration, 6),
        "frames_per_s": loop.rate,
        "strides": loop.strides,
    }
    if one is None:
        return entry | {"certified": False, "note": "the standing pose; nobody has simulated it"}
    asked = {"speed": one.cell.speed, "turn": one.cell.turn}
    return entry | {
        "asked": asked,
        "certified": one.certified,
        "gait": one.gait,
        "duty_factor": round(one.duty or 0.0, 4),
        "run": name,
    }
