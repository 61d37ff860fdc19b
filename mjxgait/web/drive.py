"""One HTML file in which a repertoire is driven by keys or a stick: its clips, blended."""

import base64
import html
import json
import string
from importlib import resources
from pathlib import Path

from mjxgait.animation import build_driven
from mjxgait.errors import UserError
from mjxgait.repertoire.clips import TABLE, clips_of, table_of
from mjxgait.repertoire.found import found_in
from mjxgait.repertoire.grid import Grid
from mjxgait.web.page import viewer_script, write_text

RATE = 60
FAR = 3.2
"""Of the camera, in units of the creature's size: farther than of a walk, for it goes somewhere."""
KEPT = ("name", "speed", "turn", "duration")


def write_driven(folder: Path, out: Path) -> None:
    """Writes the page of a repertoire's certified walks.

    Raises:
      UserError: no repertoire, none of its walks is certified, or the file cannot be written.
    """
    grid = Grid.read(folder)
    found = found_in(folder, grid)
    loops = clips_of(folder, found, RATE)
    if not loops:
        raise UserError(
            f"{folder}: none of its walks is certified, so there is nothing to drive; "
            f"`mjxgait inspect {folder}` says why"
        )
    creature = next(iter(loops.values())).walk.creature
    clips = table_of("", loops, found, travelling=False)["clips"]
    glb, apart = build_driven(loops)
    page = string.Template(
        (resources.files("mjxgait.web") / "assets" / "drive.html").read_text(encoding="utf-8")
    ).substitute(
        title=html.escape(creature.name.replace("_", " ")),
        walks=len(clips) - 1,
        of=len(found),
        blends=html.escape(_blends(folder)),
        clips=json.dumps([{key: clip[key] for key in KEPT} for clip in clips]),
        apart=apart,
        glb=base64.b64encode(glb).decode("ascii"),
        target=f"0m {0.6 * creature.frame.stand_pos[2]:.3f}m 0m",
        far=f"{FAR * creature.model.stat.extent:.3f}m",
        viewer=viewer_script(),
    )
    write_text(out, page)


def _blends(folder: Path) -> str:
    """How many blends were tried as physics, and how many walked."""
    try:
        tried = json.loads((folder / TABLE).read_text(encoding="utf-8"))["blends"]
        walking = sum(bool(blend["walks"]) for blend in tried)
    except (OSError, ValueError, KeyError, TypeError):
        tried, walking = [], 0
    if not tried:
        return "no blend of them has been tried as physics"
    return f"half way between neighbours {walking} of {len(tried)} walk as physics too"
