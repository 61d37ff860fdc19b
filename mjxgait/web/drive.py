"""One HTML file that drives a creature by keys or a stick, with the clips of its walks blended."""

import base64
import html
import json
import string
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from mjxgait.animation.export import WalkLoop, build_driven
from mjxgait.web.page import viewer_script

FAR = 3.2
"""Camera distance in units of the creature's size."""
KEPT = ("name", "speed", "turn", "duration")


def driven_page(
    loops: Mapping[str, WalkLoop], clips: Sequence[Mapping[str, Any]], of: int, blends: str
) -> str:
    """Return the text of the page.

    Args:
      loops: of one creature, by name; the first stands.
      clips: for each its name, `speed` in m/s, `turn` in deg/s and `duration` in s.
      of: number of walks requested.
      blends: physical validity of the blends, in words.
    """
    creature = next(iter(loops.values())).walk.creature
    glb, apart = build_driven(loops)
    page = resources.files("mjxgait.web") / "assets" / "drive.html"
    return string.Template(page.read_text(encoding="utf-8")).substitute(
        title=html.escape(creature.name.replace("_", " ")),
        walks=len(clips) - 1,
        of=of,
        blends=html.escape(blends),
        clips=json.dumps([{key: clip[key] for key in KEPT} for clip in clips]),
        apart=apart,
        glb=base64.b64encode(glb).decode("ascii"),
        target=f"0m {0.6 * creature.frame.stand_pos[2]:.3f}m 0m",
        far=f"{FAR * creature.model.stat.extent:.3f}m",
        viewer=viewer_script(),
    )
