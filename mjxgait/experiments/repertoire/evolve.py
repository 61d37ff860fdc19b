"""Evolution of a repertoire: first all straight walks, then, from these, all turning walks.

Each of the two is one program with a row per cell. In every generation a cell evaluates, among its
offspring, one of the best individuals of each neighbour. Each cell has its own run folder.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from mjxgait.creature import Creature
from mjxgait.distributed.jobs import Advanced
from mjxgait.distributed.rows import Rows
from mjxgait.distributed.scheduler import Crew
from mjxgait.experiments.repertoire.cells import has_mirror, mirror_image, planted
from mjxgait.experiments.repertoire.grid import Cell, Grid

Tell = Callable[[str, int, int, Advanced | None], object]
"""Callback with the evolved part, the generation, the last generation, and a result, if any."""


def evolve(
    folder: Path,
    creature: Creature,
    grid: Grid,
    crew: Crew,
    tell: Tell,
    stopped: Callable[[], bool],
) -> bool:
    """Evolve all cells of a folder, or resume them; return whether all were completed."""
    straight = [cell for cell in grid.cells if not cell.turn]
    both = not has_mirror(creature)
    turning = [cell for cell in grid.cells if cell.turn > 0 or (cell.turn and both)]
    first = _side(folder, creature, grid, straight)
    found = first.to_the_end(None, crew, partial(tell, "straight on"), stopped)
    if found is None or not turning:
        return found is not None
    by_speed = {cell.speed: found.row(row) for row, cell in enumerate(straight)}
    begin = planted(turning, by_speed)
    second = _side(folder, creature, grid, turning)
    return second.to_the_end(begin, crew, partial(tell, "turning"), stopped) is not None


def _side(folder: Path, creature: Creature, grid: Grid, cells: Sequence[Cell]) -> Rows:
    """Return cells as rows of one program.

    A symmetric body's right turns are mirror images of its left turns; they have folders, too.
    """
    near = [[n for n in grid.neighbours(cell) if n in cells] for cell in cells]
    sources = [[cells.index(n) for n in known] for known in near]
    image = partial(mirror_image, creature=creature)
    images = {
        folder / cell.name: (folder / cell.mirrored.name, image)
        for cell in cells
        if cell.turn and has_mirror(creature)
    }
    return Rows(creature, [folder / cell.name for cell in cells], sources, images)
