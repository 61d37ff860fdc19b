"""Whose child somebody is, from what the log of a run tells of each generation."""

from collections.abc import Mapping, Sequence
from typing import Any

from mjxgait.evolution.state import NOBODY
from mjxgait.training.folder import MOTHERS


def mothers_line(lines: Sequence[Mapping[str, Any]], generation: int, place: int) -> dict[int, int]:
    """By generation, latest first, the place of somebody's first ancestors in the population.

    Back to where somebody has no mother, or the log does not tell.
    """
    known = {line["generation"]: line[MOTHERS] for line in lines if MOTHERS in line}
    found = {generation: place}
    while (mother := _mother(known.get(generation, ()), place)) != NOBODY:
        generation, place = generation - 1, mother
        found[generation] = place
    return found


def _mother(places: Sequence[int], place: int) -> int:
    """The place of somebody's mother; nobody where the log does not tell."""
    return places[place] if 0 <= place < len(places) else NOBODY
