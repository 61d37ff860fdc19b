"""Whole runs as rows of one program, each with a run folder of its own."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjxgait.cluster.crew import Crew
from mjxgait.cluster.jobs import Advanced, AdvanceRows
from mjxgait.cluster.recipe import Recipe
from mjxgait.creature import Creature
from mjxgait.runs.checkpoint import Checkpoints
from mjxgait.runs.disk import disk_errors
from mjxgait.runs.folder import METRICS, open_run, truncate_metrics
from mjxgait.runs.packed import Packed, side_by_side
from mjxgait.settings.config import Config

Tell = Callable[[int, int, Advanced | None], object]
"""Called with the generation, the last one, and what has come back, if something has."""


class Rows:
    """Runs that go on together, from the folders that they were made in.

    Attributes:
      sources: see `build_batch`. images: a row's second folder, where there is one, with what is
        written there in place of its state.
      keep_every: see `Checkpoints`; by default no generation stays but the latest.
    """

    def __init__(
        self,
        creature: Creature,
        folders: Sequence[Path],
        sources: Sequence[Sequence[int]] = (),
        images: Mapping[Path, tuple[Path, Callable[[Packed], Packed]]] | None = None,
        keep_every: int | None = None,
    ) -> None:
        self.creature, self.folders, self.images = creature, list(folders), images or {}
        self.configs: list[Config] = [open_run(folder)[1] for folder in folders]
        self.recipe = Recipe.of(creature, self.configs, sources)
        self.last = self.configs[0].evolution.generations
        self.keep_every = keep_every or self.last + 1

    def to_the_end(
        self,
        begin: Mapping[str, np.ndarray] | None,
        crew: Crew,
        tell: Tell,
        stopped: Callable[[], bool],
    ) -> Packed | None:
        """The states [B] of the last generation; None when told to stop. begin: see `AdvanceRows`."""
        seconds = [folder for folder, _ in self.images.values()]
        stores = {path: Checkpoints(path, self.keep_every) for path in [*self.folders, *seconds]}
        try:
            state = self._stored(stores)
            stride = self.configs[0].checkpoint_every
            generation = -1 if state is None else state.generation
            if generation < self.last:
                tell(generation, self.last, None)
            while generation < self.last:
                until = min((max(generation, 0) // stride + 1) * stride, self.last)
                job = AdvanceRows(state, until, begin if state is None else None)
                if (done := crew.all([(self.recipe, job)], stopped)) is None:
                    return None
                state, generation = done[0].packed, until
                self._keep(stores, done[0])
                tell(generation, self.last, done[0])
            return state
        finally:
            for store in stores.values():
                store.close()

    def _stored(self, stores: Mapping[Path, Checkpoints]) -> Packed | None:
        """What was left by the latest generation that all have a checkpoint of."""
        known = set.intersection(*(set(store.generations()) for store in stores.values()))
        common = max(known, default=-1)
        for folder, store in stores.items():
            store.drop_after(common)
            truncate_metrics(folder / METRICS, common)
        if common < 0:
            return None
        return side_by_side(
            [stores[folder].read(self.creature.digest, common) for folder in self.folders]
        )

    def _keep(self, stores: Mapping[Path, Checkpoints], advanced: Advanced) -> None:
        for row, folder in enumerate(self.folders):
            state = advanced.packed.row(row)
            lines = [line[row] for line in advanced.lines]
            self._write(stores, folder, state, lines)
            if folder in self.images:
                second, image = self.images[folder]
                self._write(stores, second, image(state), lines)

    def _write(
        self,
        stores: Mapping[Path, Checkpoints],
        folder: Path,
        state: Packed,
        lines: Iterable[Mapping[str, Any]],
    ) -> None:
        """First the log, for a resumed run takes lines out, last the state."""
        path = folder / METRICS
        with disk_errors(folder), path.open("a", encoding="utf-8") as log:
            log.writelines(json.dumps(line) + "\n" for line in lines)
        stores[folder].keep(state, self.creature.name, self.creature.digest)
