"""A repertoire of one stored walk: at its speed, at half, and as if it turned to either side."""

import dataclasses
import json
from pathlib import Path

import numpy as np

from mjxgait.animation.export import (
    animation_of,
    build_clips,
    contacts,
    standing_still,
    stride_in_phase,
)
from mjxgait.experiments.repertoire.clips import CLIPS, IDLE, TABLE
from mjxgait.experiments.repertoire.table import table_of
from mjxgait.rendering.walk import record_walk
from mjxgait.training.folder import open_champion

STORED = Path(__file__).parents[2] / "docs" / "data" / "walk"
TURN = 20.0
"""Degrees per second."""


def write_repertoire(folder: Path, turns: bool = True) -> dict:
    """Write the clips and their table; return the table. turns: with walks that turn."""
    fast = stride_in_phase(record_walk(*open_champion(STORED), 6.0), 60)
    slow = dataclasses.replace(fast, rate=30)
    loops = {IDLE: standing_still(fast)} | {
        f"{name}_{turn:.0f}": dataclasses.replace(loop, turned=np.radians(turn) * loop.times[-1])
        for name, loop in (("slow", slow), ("fast", fast))
        for turn in ((0.0, TURN, -TURN) if turns else (0.0,))
    }
    table = table_of(CLIPS, loops, [], travelling=False)
    for clip in table["clips"]:
        clip["contacts"] = contacts(loops[clip["name"]], fast.walk.creature.feet.names)
    clips = {animation_of(name, loop): loop for name, loop in loops.items()}
    (folder / CLIPS).write_bytes(build_clips(clips))
    (folder / TABLE).write_text(json.dumps(table))
    return table
