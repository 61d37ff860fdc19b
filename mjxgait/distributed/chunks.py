"""One large population: each generation's offspring, evaluated in chunks by all workers."""

from collections.abc import Iterator, Sequence
from typing import Any

import jax
import numpy as np

from mjxgait.config.schema import Config
from mjxgait.creature import Creature
from mjxgait.distributed.jobs import Job, Judge
from mjxgait.distributed.recipe import Recipe
from mjxgait.distributed.scheduler import Crew
from mjxgait.errors import UserError
from mjxgait.tasks.starts import Starts
from mjxgait.types import Asked, Judged


class Blocks:
    """Chunked `Evaluator`: a crew evaluates a run's genomes in chunks of equal size.

    The size fixes a chunk's bits: they do not depend on the number of machines.

    Raises:
      UserError: the offspring of a generation cannot be cut into equal chunks of about that size.
    """

    def __init__(self, crew: Crew, creature: Creature, config: Config) -> None:
        self._crew, self._recipe = crew, Recipe.of(creature, [config])
        self.size = block_size(config.evolution.offspring, config.rollout.block)

    def judge(
        self, genomes: Any, trials: Starts, settings: Config, asked: Asked | None = None
    ) -> Judged:
        """See `Evaluator`. Takes one row; its settings are in the recipe."""
        genomes, trials, asked = jax.device_get((genomes, trials, asked))
        return together(self._crew.all(self._work(genomes, trials, asked)) or ())

    def _work(
        self, genomes: Any, trials: Starts, asked: Asked | None
    ) -> Iterator[tuple[Recipe, Job]]:
        count = jax.tree.leaves(genomes)[0].shape[1]
        for first in range(0, count, self.size):

            def cut(leaf: np.ndarray, first: int = first) -> np.ndarray:
                # The steps spent are the whole generation's: only the first chunk counts them.
                part = slice(first, first + self.size)
                return leaf[:, part] if leaf.ndim > 1 else leaf * (first == 0)

            block, known = jax.tree.map(cut, (genomes, asked))
            yield self._recipe, Judge(block, trials, known)


def block_size(offspring: int, most: int) -> int:
    """Return the largest size of equal chunks that is at most `most`.

    Raises:
      UserError: that size is less than half of `most`.
    """
    size = next(n for n in range(min(most, offspring), 0, -1) if offspring % n == 0)
    if 2 * size < min(most, offspring):
        raise UserError(
            f"{offspring} offspring of a generation cannot be cut into equal blocks of at most {most}; "
            "take another --population or --rollout.block"
        )
    return size


def together(blocks: Sequence[Judged]) -> Judged:
    """Join the results of chunks: leaves [B, n, ...] are concatenated, steps [B] are summed."""

    def joined(*leaves: np.ndarray) -> np.ndarray:
        if leaves[0].ndim > 1:
            return np.concatenate(leaves, axis=1)
        return np.sum(leaves, axis=0, dtype=leaves[0].dtype)

    return jax.tree.map(joined, *blocks)
