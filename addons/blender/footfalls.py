"""Footfalls that an exported walk states in its file. Runs without Blender."""

import json
import struct
from pathlib import Path

HEADER, CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")


def footfalls_in(file: Path, name: str) -> list[tuple[str, float]]:
    """Return foot and time in s of each footfall in an animation; none if the file states none.

    name: beginning of the animation's name.
    """
    try:
        with open(file, "rb") as data:
            data.seek(HEADER.size)
            length, _ = CHUNK.unpack(data.read(CHUNK.size))
            animations = json.loads(data.read(length))["animations"]
        walks = [each for each in animations if str(each.get("name")).startswith(name)]
        falls = walks[0]["extras"]["contacts"] if walks else []
        return [(str(fall["foot"]), float(fall["down"])) for fall in falls]
    except (OSError, struct.error, ValueError, LookupError, TypeError):
        return []  # markers are an extra; the walk itself is read by Blender
