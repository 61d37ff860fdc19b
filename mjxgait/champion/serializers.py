"""How each kind of genome is written for people and read again.

A genome is a handful of named arrays; that is all that evolution, checkpoints and the champion's
file ask of it. Shapes and names are the controller's own.
"""

import functools
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from mjxgait.champion.plain import Genome, PlainCodec
from mjxgait.creature import Creature


class Codec(Protocol):
    """Between the arrays of a kind of genome and what `champion.json` says of it."""

    def settled(self, genome: Genome, creature: Creature) -> dict[str, np.ndarray]:
        """The arrays of a champion: those that its file will give back."""
        ...

    def document(self, genome: Genome, settings: Any, creature: Creature) -> dict[str, Any]:
        """What people read."""
        ...

    def genome(self, document: Mapping[str, Any], creature: Creature) -> dict[str, np.ndarray]:
        """The arrays of a document.

        Raises:
          KeyError, TypeError, ValueError: it is not of this kind.
        """
        ...

    def settings(self, table: Mapping[str, Any], where: str) -> Any:
        """The settings of its controller from a table of the file `where`."""
        ...

    def check(self, genome: Genome, creature: Creature) -> None:
        """Refuses numbers that nobody can follow.

        Raises:
          UserError: names the first.
        """
        ...

    def shapes(self, settings: Any, creature: Creature) -> dict[str, tuple[int, ...]]:
        """Shapes that the settings demand of the arrays, as far as they do."""
        ...

    def embodied(self, genome: Genome, settings: Any, task: str, creature: Creature) -> Creature:
        """The body that the genome grows into; the creature itself where nothing grows."""
        ...


@functools.cache
def codecs() -> Mapping[str, Codec]:
    """Return the codecs by the name of the controller; imported late, for each imports this package."""
    from mjxgait.controllers.expressions.serialize import ProgramCodec
    from mjxgait.controllers.key_poses.serialize import PoseCodec
    from mjxgait.controllers.sims_brain.serialize import GraphCodec

    return {"poses": PoseCodec(), "program": ProgramCodec(), "brain": GraphCodec()}


def codec_of(controller: str) -> Codec:
    """That of a controller."""
    return codecs().get(controller, PlainCodec())
