"""Whole runs as rows of one program, and one large population in chunks."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

import jax
import numpy as np

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.distributed.drive import drive
from mjxgait.distributed.jobs import Advanced, AdvanceRows, Evaluate, Lines, Recipe
from mjxgait.distributed.scheduler import Scheduler
from mjxgait.errors import UserError
from mjxgait.tasks.starts import Starts
from mjxgait.training.checkpoint import Checkpoints, Packed, side_by_side
from mjxgait.training.folder import METRICS, open_run
from mjxgait.training.logs import append_lines, truncate_metrics
from mjxgait.types import Evaluation, RequestedTrials

RowsProgress = Callable[[int, int, Advanced | None], object]
"""Called with the generation, the last generation, and the latest result, if there is one."""


class Rows:
    """Runs that advance together, from the folders that they were made in.

    Attributes:
      sources: see `build_batch`. images: a row's second folder, if it has one, and the function
        that makes what is written there from its state.
      planted: see `AdvanceRows`; of all rows.
      keep_every: see `Checkpoints`; by default only the latest generation stays.
      together: rows per job; 0: all, as those with sources must be.
    """

    def __init__(
        self,
        creature: Creature,
        folders: Sequence[Path],
        tell: RowsProgress,
        sources: Sequence[Sequence[int]] = (),
        images: Mapping[Path, tuple[Path, Callable[[Packed], Packed]]] | None = None,
        planted: Mapping[str, np.ndarray] | None = None,
        keep_every: int | None = None,
        together: int = 0,
    ) -> None:
        self._tell, self.planted = tell, planted
        self.creature, self.folders, self.images = creature, list(folders), images or {}
        self.configs: list[Config] = [open_run(folder)[1] for folder in folders]
        size = together or len(self.folders)
        self.pieces = [slice(at, at + size) for at in range(0, len(self.folders), size)]
        self.recipes = [Recipe.of(creature, self.configs[piece], sources) for piece in self.pieces]
        self.last = self.configs[0].evolution.generations
        self.keep_every = keep_every or self.last + 1
        self.state: Packed | None = None
        self._stores: dict[Path, Checkpoints] = {}

    def to_the_end(self, scheduler: Scheduler, stopped: Callable[[], bool]) -> Packed | None:
        """Return the states [B] of the last generation; None when stopped."""
        seconds = [folder for folder, _ in self.images.values()]
        self._stores = {p: Checkpoints(p, self.keep_every) for p in [*self.folders, *seconds]}
        self.state = self._stored()
        if not self.ended:
            self._tell(self.generation, self.last, None)
        return self.state if drive([self], scheduler, stopped) else None

    @property
    def generation(self) -> int:
        """Generation that the rows have reached; -1 before the first."""
        return -1 if self.state is None else self.state.generation

    @property
    def jobs(self) -> int:
        """Number of jobs that lead to the next stop: one for each piece."""
        return len(self.pieces)

    @property
    def ended(self) -> bool:
        """Whether the rows have reached their last generation."""
        return self.generation >= self.last

    @property
    def _next_stop(self) -> int:
        stride = self.configs[0].checkpoint_every
        return min((max(self.generation, 0) // stride + 1) * stride, self.last)

    def job(self, number: int) -> tuple[Recipe, AdvanceRows]:
        """Return the job of one piece."""
        recipe, piece = self.recipes[number], self.pieces[number]
        if self.state is not None:
            return recipe, AdvanceRows(self.state[piece], self._next_stop)
        planted = self.planted and {name: array[piece] for name, array in self.planted.items()}
        return recipe, AdvanceRows(None, self._next_stop, planted)

    def keep(self, done: Sequence[Advanced]) -> None:
        """Write the log first, the state last: resuming removes surplus lines."""
        advanced = _joined(done)
        self.state = advanced.packed
        for row, folder in enumerate(self.folders):
            state = advanced.packed[row]
            lines = [line[row] for line in advanced.lines]
            self._write(folder, state, lines)
            if folder in self.images:
                second, image = self.images[folder]
                self._write(second, image(state), lines)
        self._tell(self.generation, self.last, advanced)

    def close(self) -> None:
        """Wait until everything is on disk."""
        for store in self._stores.values():
            store.close()

    def _stored(self) -> Packed | None:
        """Restore the latest generation that all folders have a checkpoint of; None if none."""
        known = set.intersection(*(set(store.generations()) for store in self._stores.values()))
        common = max(known, default=-1)
        for folder, store in self._stores.items():
            store.drop_after(common)
            truncate_metrics(folder / METRICS, common)
        if common < 0:
            return None
        return side_by_side(
            [self._stores[folder].read(self.creature.digest, common) for folder in self.folders]
        )

    def _write(self, folder: Path, state: Packed, lines: Lines) -> None:
        append_lines(folder / METRICS, lines)
        self._stores[folder].keep(state, self.creature.name, self.creature.digest)


def _joined(pieces: Sequence[Advanced]) -> Advanced:
    """Join the results of jobs that ran at the same time."""
    rows = [piece.packed[row] for piece in pieces for row in range(piece.packed.count)]
    return Advanced(
        side_by_side(rows),
        [list(chain(*lines)) for lines in zip(*(piece.lines for piece in pieces), strict=True)],
        pieces[0].note,
        max(piece.seconds for piece in pieces),
        sum(piece.steps for piece in pieces),
    )


class ChunkedEvaluator:
    """Chunked `Evaluator`: a scheduler evaluates a run's genomes in chunks of equal size.

    The size fixes a chunk's bits: they do not depend on the number of machines.

    Raises:
      UserError: the offspring of a generation cannot be cut into equal chunks of about that size.
    """

    def __init__(self, scheduler: Scheduler, creature: Creature, config: Config) -> None:
        self._scheduler, self._recipe = scheduler, Recipe.of(creature, [config])
        self.size = block_size(config.evolution.offspring, config.rollout.block)

    def evaluate(
        self,
        genomes: object,
        trials: Starts,
        settings: Config,
        requested: RequestedTrials | None = None,
    ) -> Evaluation:
        """Takes one row; its settings are in the recipe."""
        genomes, trials, requested = jax.device_get((genomes, trials, requested))
        return together(self._scheduler.all(self._work(genomes, trials, requested)) or ())

    def _work(
        self, genomes: object, trials: Starts, requested: RequestedTrials | None
    ) -> Iterator[tuple[Recipe, Evaluate]]:
        count = jax.tree.leaves(genomes)[0].shape[1]
        for first in range(0, count, self.size):

            def cut(leaf: np.ndarray, first: int = first) -> np.ndarray:
                # The steps spent are the whole generation's: only the first chunk counts them.
                part = slice(first, first + self.size)
                return leaf[:, part] if leaf.ndim > 1 else leaf * (first == 0)

            block, known = jax.tree.map(cut, (genomes, requested))
            yield self._recipe, Evaluate(block, trials, known)


def block_size(offspring: int, most: int) -> int:
    """Return the largest size of equal chunks that is at most `most`.

    Raises:
      UserError: that size is less than half of `most`.
    """
    size = next(n for n in range(min(most, offspring), 0, -1) if offspring % n == 0)
    if 2 * size < min(most, offspring):
        raise UserError(
            f"{offspring} offspring of a generation cannot be cut into equal blocks of at most "
            f"{most}; take another --population or --rollout.block"
        )
    return size


def together(blocks: Sequence[Evaluation]) -> Evaluation:
    """Join the results of chunks: leaves [B, n, ...] are concatenated, steps [B] are summed."""

    def joined(*leaves: np.ndarray) -> np.ndarray:
        if leaves[0].ndim > 1:
            return np.concatenate(leaves, axis=1)
        return np.sum(leaves, axis=0, dtype=leaves[0].dtype)

    return jax.tree.map(joined, *blocks)
