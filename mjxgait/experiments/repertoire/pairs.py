"""Pairs of certified neighbours of a repertoire, and a test of each pair."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from mjxgait.cores import one_per_core
from mjxgait.creature import Creature
from mjxgait.experiments.repertoire.cells import has_mirror
from mjxgait.experiments.repertoire.found import Found
from mjxgait.experiments.repertoire.grid import Cell, Grid

Pair = tuple[Cell, Cell]
Tried = TypeVar("Tried")


def certified_pairs(creature: Creature, grid: Grid, found: list[Found]) -> list[Pair]:
    """Return all neighbours that are both certified.

    A symmetric body's right turns are left out: they are mirror images of the left turns.
    """
    known = {one.cell for one in found if one.certified}
    lowest = 0.0 if has_mirror(creature) else -np.inf
    return [
        pair
        for pair in grid.pairs
        if known.issuperset(pair) and min(cell.turn for cell in pair) >= lowest
    ]


def of_each(
    work: Callable[[Path, Pair], Tried],
    folder: Path,
    pairs: Sequence[Pair],
    tell: Callable[[int, int], object],
) -> list[Tried]:
    """Return the work's result for each pair, in order; one pair per core.

    tell: called with the counts done and total.

    Raises:
      UserError: a process was killed from outside.
    """
    again = f"mjxgait repertoire --resume {folder}"
    tried = one_per_core(partial(work, folder), pairs, tell, folder=folder, again=again)
    return tried or []
