"""Repertoire as a web page to share, with a creature to steer."""

from pathlib import Path

from mjxgait.errors import UserError
from mjxgait.experiments.repertoire.clips import TABLE, clips_of, table_of
from mjxgait.experiments.repertoire.found import found_in
from mjxgait.experiments.repertoire.grid import Grid
from mjxgait.files import read_json
from mjxgait.web.drive import driven_page
from mjxgait.web.page import write_text

RATE = 60


def write_driven(folder: Path, out: Path) -> str:
    """Write the page of a repertoire's certified walks; return an empty note.

    Raises:
      UserError: no repertoire, none of its walks is certified, or the file cannot be written.
    """
    found = found_in(folder, Grid.read(folder))
    loops = clips_of(folder, found, RATE)
    if not loops:
        raise UserError(
            f"{folder}: none of its walks is certified, so there is nothing to drive; "
            f"`mjxgait inspect {folder}` says why"
        )
    clips = table_of("", loops, found, travelling=False)["clips"]
    write_text(out, driven_page(loops, clips, len(found), _blends(folder)))
    return ""


def _blends(folder: Path) -> str:
    """Return a line with the number of blends tried as physics, and of those that walked."""
    try:
        tried = read_json(folder / TABLE)["blends"]
        walking = sum(bool(blend["walks"]) for blend in tried)
    except (UserError, ValueError, LookupError, TypeError):
        tried, walking = [], 0
    if not tried:
        return "no blend of them has been tried as physics"
    return f"half way between neighbours {walking} of {len(tried)} walk as physics too"
