"""The table of a repertoire, `repertoire.json`: each clip's place in a blend space."""

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from mjxgait.animation.clips.glb_document import DESCRIPTION, read_chunks
from mjxgait.animation.export import WalkLoop, animation_of, contacts
from mjxgait.experiments.repertoire.found import Found

SCHEMA = 1
UNITS = {"speed": "m/s", "way": "m", "turn": "deg/s, to the left", "duration": "s"}
"""Units of the table. Metres are those of the file, which engines import as their own."""


Facts = Mapping[str, Mapping[str, Any]]
"""What a file states about each of its animations, by name."""


def facts_in(data: bytes, names: Collection[str]) -> Facts:
    """Return what a GLB states about these animations."""
    animations = json.loads(read_chunks(data)[DESCRIPTION])["animations"]
    return {each["name"]: each["extras"] for each in animations if each.get("name") in names}


def make_theirs(document: dict[str, Any], names: Mapping[str, str], facts: Facts) -> None:
    """Put a character's animations, bones and metres into the table.

    names: of its animations, by that of the clip. An engine takes a unit of the file for a metre.
    """
    scale = document["scale"] = next(iter(facts.values()))["scale"]
    bones: dict[str, str] = {}
    for entry in document["clips"]:
        entry["animation"] = names[entry["animation"]]
        own = entry.get("contacts", [])
        # Without footfalls the file has no such key.
        theirs = facts[entry["animation"]].get("contacts", []) if own else []
        for fall, their in zip(own, theirs, strict=True):
            bones[fall["foot"]] = fall["foot"] = their["foot"]
        for place in (entry, entry.get("asked")):
            _enlarge(place or {}, "speed", scale)
    for entry in document["transitions"]:
        if entry["found"]:
            entry["animation"] = names[entry["name"]]
            for fall in entry["contacts"]:
                fall["foot"] = bones.get(fall["foot"], fall["foot"])
        _enlarge(entry, "way", scale)
    for entry in document["not_certified"]:
        _enlarge(entry, "speed", scale)


def _enlarge(entry: dict[str, Any], key: str, scale: float) -> None:
    """Multiply a number of an entry that has it."""
    if key in entry:
        entry[key] = round(scale * entry[key], 4)


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
        "units": UNITS,
        "scale": 1.0,
        "root_motion": travelling,
        "begins": f"where {walk.creature.feet.names[0]} comes down",
        "clips": clips,
        "not_certified": [
            {"speed": one.cell.speed, "turn": one.cell.turn, "fails": list(one.fails)}
            for one in found
            if not one.certified
        ],
    }


def _entry(name: str, loop: WalkLoop, one: Found | None) -> dict[str, object]:
    """Return a clip's entry. speed, turn: measured, for blending; asked: the cell's targets."""
    duration = float(loop.times[-1])
    entry: dict[str, object] = {
        "name": name,
        "animation": animation_of(name, loop),
        "speed": round(loop.speed, 4),
        "turn": round(float(np.degrees(loop.turned)) / duration, 3),
        "duration": round(duration, 6),
        "frames_per_s": loop.rate,
        "strides": loop.strides,
    }
    if one is None:
        return entry | {"certified": False, "note": "the standing pose; it was not simulated"}
    asked = {"speed": one.cell.speed, "turn": one.cell.turn}
    return entry | {
        "asked": asked,
        "certified": one.certified,
        "gait": one.gait,
        "duty_factor": round(one.duty or 0.0, 4),
        "run": name,
        "contacts": contacts(loop, loop.walk.creature.feet.names),
    }
