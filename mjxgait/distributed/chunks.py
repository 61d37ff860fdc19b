"""One large population: the offspring of a generation, judged in blocks by everybody who is there."""

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
    """See `Evaluator`: a run's genomes, judged by a crew in blocks of equal size.

    With its size a block's bits are the same, however many machines there are.

    Raises:
      UserError: the offspring of a generation cannot be cut into equal blocks of about that size.
    """

    def __init__(self, crew: Crew, creature: Creature, config: Config) -> None:
        self._crew, self._recipe = crew, Recipe.of(creature, [config])
        self.size = block_size(config.evolution.offspring, config.rollout.block)

    def judge(
        self, genomes: Any, trials: Starts, settings: Config, asked: Asked | None = None
    ) -> Judged:
        """See `Evaluator`. One row; its settings are in the recipe."""
        genomes, trials, asked = jax.device_get((genomes, trials, asked))
        return together(self._crew.all(self._work(genomes, trials, asked)) or ())

    def _work(
        self, genomes: Any, trials: Starts, asked: Asked | None
    ) -> Iterator[tuple[Recipe, Job]]:
        count = jax.tree.leaves(genomes)[0].shape[1]
        for first in range(0, count, self.size):

            def cut(leaf: np.ndarray, first: int = first) -> np.ndarray:
                # What has been spent is the whole generation's: the first block counts it.
                part = slice(first, first + self.size)
                return leaf[:, part] if leaf.ndim > 1 else leaf * (first == 0)

            block, known = jax.tree.map(cut, (genomes, asked))
            yield self._recipe, Judge(block, trials, known)


def block_size(offspring: int, most: int) -> int:
    """The largest size of equal blocks that is not above `most`.

    Raises:
      UserError: it would be less than half of that.
    """
    size = next(n for n in range(min(most, offspring), 0, -1) if offspring % n == 0)
    if 2 * size < min(most, offspring):
        raise UserError(
            f"{offspring} offspring of a generation cannot be cut into equal blocks of at most {most}; "
            "take another --population or --rollout.block"
        )
    return size


def together(blocks: Sequence[Judged]) -> Judged:
    """The verdict on all individuals, from those on blocks of them; leaves [B, n, ...], steps [B]."""

    def joined(*leaves: np.ndarray) -> np.ndarray:
        if leaves[0].ndim > 1:
            return np.concatenate(leaves, axis=1)
        return np.sum(leaves, axis=0, dtype=leaves[0].dtype)

    return jax.tree.map(joined, *blocks)
