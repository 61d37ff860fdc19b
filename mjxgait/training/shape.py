"""Program key: runs with the same key share compiled programs."""

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
    """Key of a run's compiled programs.

    body: digest of the creature. settings: their structure; traced numbers may differ. code: the
    controller and task classes, so that redefining a class in a notebook changes the key.
    """

    body: str
    settings: Any
    code: tuple[Hashable, ...]

    def name(self, *more: Hashable) -> str:
        """Return a hash of body and settings, the same in all processes; `code` is left out."""
        return hashlib.sha256(repr((self.body, self.settings, *more)).encode()).hexdigest()[:16]


def shape_of(creature: Creature, config: Config) -> Shape:
    """Return the program key of a creature's run under a config."""
    code = (find("controller", config.use.controller), find("task", config.use.task))
    return Shape(creature.digest, jax.tree.structure(traced(config)), code)
