"""Ancestors of an individual, from the log of a run."""

from collections.abc import Mapping, Sequence
from typing import Any

from mjxgait.evolution.state import NOBODY
from mjxgait.training.folder import MOTHERS


def mothers_line(lines: Sequence[Mapping[str, Any]], generation: int, place: int) -> dict[int, int]:
    """Return the places of an individual's maternal ancestors by generation, latest first.

    The line ends at an individual without a mother or a generation without a log line.
    """
    known = {line["generation"]: line[MOTHERS] for line in lines if MOTHERS in line}
    found = {generation: place}
    while (mother := _mother(known.get(generation, ()), place)) != NOBODY:
        generation, place = generation - 1, mother
        found[generation] = place
    return found


def _mother(places: Sequence[int], place: int) -> int:
    """Return the place of an individual's mother; `NOBODY` if the log does not have it."""
    return places[place] if 0 <= place < len(places) else NOBODY
