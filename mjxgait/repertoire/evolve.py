"""The evolution of a repertoire: first all that walk straight on, then, from these, all that turn.

Each of the two is one program, whose rows are the cells. In every generation a cell has one of the
best of each of its neighbours judged among its own children. Each cell is a run folder of its own.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.cluster.crew import Crew
from mjxgait.cluster.jobs import Advanced, AdvanceRows
from mjxgait.cluster.recipe import Recipe
from mjxgait.creature import Creature
from mjxgait.repertoire.cells import has_mirror, mirror_image, planted
from mjxgait.repertoire.grid import Cell, Grid
from mjxgait.runs.checkpoint import Checkpoints
from mjxgait.runs.disk import disk_errors
from mjxgait.runs.folder import METRICS, open_run, truncate_metrics
from mjxgait.runs.packed import Packed, side_by_side
from mjxgait.settings.config import Config

Tell = Callable[[str, int, int, Advanced | None], object]
"""Called with what is evolved, the generation, the last one, and what has come back, if something has."""


def evolve(
    folder: Path,
    creature: Creature,
    grid: Grid,
    crew: Crew,
    tell: Tell,
    stopped: Callable[[], bool],
) -> bool:
    """Evolves all cells of a folder, or goes on with them; returns whether they came to their end."""
    straight = [cell for cell in grid.cells if not cell.turn]
    both = not has_mirror(creature)
    turning = [cell for cell in grid.cells if cell.turn > 0 or (cell.turn and both)]
    first = Side(folder, creature, grid, straight, "straight on")
    found = first.to_the_end(None, crew, tell, stopped)
    if found is None or not turning:
        return found is not None
    by_speed = {cell.speed: found.row(row) for row, cell in enumerate(straight)}
    begin = planted(turning, by_speed)
    second = Side(folder, creature, grid, turning, "turning")
    return second.to_the_end(begin, crew, tell, stopped) is not None


class Side:
    """Cells that are rows of one program, each in its folder; those to the right of a symmetric
    body are the mirror images of those to the left, and lie in folders of their own too.
    """

    def __init__(
        self, folder: Path, creature: Creature, grid: Grid, cells: Sequence[Cell], name: str
    ) -> None:
        self.folder, self.creature, self.cells, self.name = folder, creature, list(cells), name
        self.configs: list[Config] = [open_run(folder / cell.name)[1] for cell in cells]
        near = [[n for n in grid.neighbours(cell) if n in self.cells] for cell in cells]
        sources = [[self.cells.index(n) for n in known] for known in near]
        self.recipe = Recipe.of(creature, self.configs, sources)
        self.last = self.configs[0].evolution.generations

    def to_the_end(
        self,
        begin: Mapping[str, np.ndarray] | None,
        crew: Crew,
        tell: Tell,
        stopped: Callable[[], bool],
    ) -> Packed | None:
        """The states [B] of the last generation; None when told to stop. begin: see `AdvanceRows`."""
        latest = self.last + 1
        stores = {cell: Checkpoints(self.folder / cell.name, latest) for cell in self._written()}
        try:
            state = self._stored(stores)
            stride = self.configs[0].checkpoint_every
            generation = -1 if state is None else state.generation
            if generation < self.last:
                tell(self.name, generation, self.last, None)
            while generation < self.last:
                until = min((max(generation, 0) // stride + 1) * stride, self.last)
                job = AdvanceRows(state, until, begin if state is None else None)
                if (done := crew.all([(self.recipe, job)], stopped)) is None:
                    return None
                state, generation = done[0].packed, until
                self._keep(stores, done[0])
                tell(self.name, generation, self.last, done[0])
            return state
        finally:
            for store in stores.values():
                store.close()

    def _written(self) -> list[Cell]:
        twins = [cell.mirrored for cell in self.cells if cell.turn and has_mirror(self.creature)]
        return [*self.cells, *twins]

    def _stored(self, stores: Mapping[Cell, Checkpoints]) -> Packed | None:
        """What was left by the latest generation that all cells have a checkpoint of."""
        known = set.intersection(*(set(store.generations()) for store in stores.values()))
        common = max(known, default=-1)
        for cell, store in stores.items():
            store.drop_after(common)
            truncate_metrics(self.folder / cell.name / METRICS, common)
        if common < 0:
            return None
        return side_by_side(
            [stores[cell].read(self.creature.digest, common) for cell in self.cells]
        )

    def _keep(self, stores: Mapping[Cell, Checkpoints], advanced: Advanced) -> None:
        for row, cell in enumerate(self.cells):
            state = advanced.packed.row(row)
            lines = [line[row] for line in advanced.lines]
            self._write(stores, cell, state, lines)
            if cell.turn and has_mirror(self.creature):
                self._write(stores, cell.mirrored, mirror_image(state, self.creature), lines)

    def _write(
        self,
        stores: Mapping[Cell, Checkpoints],
        cell: Cell,
        state: Packed,
        lines: Sequence[Mapping[str, Any]],
    ) -> None:
        """First the log, for a resumed run takes lines out, last the state."""
        path = self.folder / cell.name / METRICS
        with disk_errors(path.parent), path.open("a", encoding="utf-8") as log:
            log.writelines(json.dumps(line) + "\n" for line in lines)
        stores[cell].keep(state, self.creature.name, self.creature.digest)
