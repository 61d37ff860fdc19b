"""Compiled programs of a process; work of the same shape reuses them."""

import dataclasses
from collections.abc import Hashable
from contextlib import AbstractContextManager
from typing import Any

import jax

from mjxgait.distributed.recipe import Recipe
from mjxgait.training.blueprint import Plan, draw_up
from mjxgait.training.devices import compiled
from mjxgait.training.experiment import Batch, Step, build_batch
from mjxgait.training.latest import Latest
from mjxgait.training.shape import Shape, shape_of
from mjxgait.training.stages import Stages, Turn, at_once
from mjxgait.types import Asked, Judged

KEPT = 8
"""Of each sort, the most recently used; a program takes some hundred MB."""


@dataclasses.dataclass(frozen=True)
class BatchShape:
    """Shape of runs side by side. rows: their number. sources: the most that one of them has."""

    run: Shape
    rows: int
    sources: int

    def name(self, *more: Hashable) -> str:
        """See `Shape.name`."""
        return self.run.name(self.rows, self.sources, *more)


class Programs:
    """Compiled programs of one process. turn: held while a program is compiled."""

    def __init__(self, turn: Turn = at_once) -> None:
        self._turn = turn
        self._batches: Latest[tuple[BatchShape, Batch]] = Latest(KEPT)
        self._plans: Latest[Plan] = Latest(KEPT)
        self._stages: Latest[Stages] = Latest(KEPT)
        self._judges: Latest[jax.stages.Compiled] = Latest(KEPT)

    def batch(self, recipe: Recipe) -> Batch:
        """Return the runs of a recipe."""
        return self._known(recipe)[1]

    def step(self, recipe: Recipe) -> Step:
        """Return the compiled generation of all runs of a recipe."""
        shape, batch = self._known(recipe)

        def turn(part: str) -> AbstractContextManager[object]:
            return self._turn(shape.name(part))

        return batch.bound(self._stages.find(shape, lambda: batch.stages(turn=turn)))

    def judge(
        self, recipe: Recipe, genomes: Any, starts: Any, asked: Asked | None = None
    ) -> Judged:
        """Evaluate genomes [1, N, ...], in NumPy."""
        shape, batch = self._known(recipe)
        count = jax.tree.leaves(genomes)[0].shape[1]

        def compile_it() -> jax.stages.Compiled:
            program = batch.lower_judge(genomes, starts, asked)
            with self._turn(shape.name("judge", count)):
                return compiled(program)

        program = self._judges.find((shape, count), compile_it)
        numbers, rows = batch.known
        given = (numbers, rows.settings, starts, genomes, *([] if asked is None else [asked]))
        judged: Judged = jax.device_get(program(*given))
        return judged

    def _known(self, recipe: Recipe) -> tuple[BatchShape, Batch]:
        """Return the runs of a recipe, and the shape of their program."""
        return self._batches.find(recipe.digest, lambda: self._built(recipe))

    def _built(self, recipe: Recipe) -> tuple[BatchShape, Batch]:
        creature, configs = recipe.read()
        shape = shape_of(creature, configs[0])
        plan = self._plans.find(shape, lambda: draw_up(creature, configs[0]))
        batch = build_batch(creature, configs, plan, recipe.sources)
        sources = max(map(len, recipe.sources), default=0)
        return BatchShape(shape, len(configs), sources), batch
