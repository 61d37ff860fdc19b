"""Programs that a process has compiled, so that work of the same shape finds them again."""

import collections
import hashlib
from collections.abc import Callable, Hashable
from contextlib import AbstractContextManager
from typing import Any, TypeVar

import jax

from mjxgait.cluster.recipe import Recipe
from mjxgait.runs.blueprint import Plan, draw_up
from mjxgait.runs.devices import compiled
from mjxgait.runs.experiment import Batch, Step, build_batch
from mjxgait.runs.stages import Stages, Turn, at_once
from mjxgait.settings.traced import traced
from mjxgait.types import Judged

T = TypeVar("T")
KEPT = 8
"""Of each sort, those that were used last; a program takes some hundred MB."""


class Programs:
    """Of one process. turn: held while a program is compiled."""

    def __init__(self, turn: Turn = at_once) -> None:
        self._turn = turn
        self._batches: _Latest[tuple[Hashable, Batch]] = _Latest()
        self._plans: _Latest[Plan] = _Latest()
        self._stages: _Latest[Stages] = _Latest()
        self._judges: _Latest[jax.stages.Compiled] = _Latest()

    def batch(self, recipe: Recipe) -> Batch:
        """The runs of a recipe."""
        return self._known(recipe)[1]

    def step(self, recipe: Recipe) -> Step:
        """A generation of all runs of a recipe."""
        shape, batch = self._known(recipe)

        def turn(part: str) -> AbstractContextManager[object]:
            return self._turn(_name(shape, part))

        return batch.bound(self._stages.find(shape, lambda: batch.stages(turn=turn)))

    def judge(self, recipe: Recipe, genomes: Any, starts: Any) -> Judged:
        """The verdict on genomes [1, N, ...], in NumPy."""
        shape, batch = self._known(recipe)
        count = jax.tree.leaves(genomes)[0].shape[1]

        def compile_it() -> jax.stages.Compiled:
            program = batch.lower_judge(genomes, starts)
            with self._turn(_name(shape, "judge", count)):
                return compiled(program)

        program = self._judges.find((shape, count), compile_it)
        numbers, rows = batch.known
        judged: Judged = jax.device_get(program(numbers, rows.settings, starts, genomes))
        return judged

    def _known(self, recipe: Recipe) -> tuple[Hashable, Batch]:
        """The runs of a recipe, and what decides the shape of their program."""
        return self._batches.find(recipe.digest, lambda: self._built(recipe))

    def _built(self, recipe: Recipe) -> tuple[Hashable, Batch]:
        creature, configs = recipe.read()
        one = (creature.digest, jax.tree.structure(traced(configs[0])))
        plan = self._plans.find(one, lambda: draw_up(creature, configs[0]))
        batch = build_batch(creature, configs, plan, recipe.sources)
        return (one, len(configs), max(map(len, recipe.sources), default=0)), batch


def _name(*key: Hashable) -> str:
    return hashlib.sha256(repr(key).encode()).hexdigest()[:16]


class _Latest(collections.OrderedDict[Hashable, T]):
    """What was used last."""

    def find(self, key: Hashable, make: Callable[[], T]) -> T:
        if key not in self:
            self[key] = make()
            while len(self) > KEPT:
                self.popitem(last=False)
        self.move_to_end(key)
        return self[key]
