"""What decides on the compiled programs of a run: two of the same shape share them."""

import dataclasses
import hashlib
from collections.abc import Hashable
from typing import Any

import jax

from mjxgait.config.schema import Config
from mjxgait.config.traced import traced
from mjxgait.creature import Creature
from mjxgait.plugins.registry import find


@dataclasses.dataclass(frozen=True)
class Shape:
    """body: its digest. settings: of which only numbers are free. code: whose takes part, as objects: who
    defines a class anew in a notebook means the new one.
    """

    body: str
    settings: Any
    code: tuple[Hashable, ...]

    def name(self, *more: Hashable) -> str:
        """The same in all processes, as far as body and settings go."""
        return hashlib.sha256(repr((self.body, self.settings, *more)).encode()).hexdigest()[:16]


def shape_of(creature: Creature, config: Config) -> Shape:
    """That of a creature's run under a config."""
    code = (find("controller", config.use.controller), find("task", config.use.task))
    return Shape(creature.digest, jax.tree.structure(traced(config)), code)
