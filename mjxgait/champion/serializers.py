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
from mjxgait.kinds import ControllerKind, known_controller


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


def codec_of(controller: str) -> Codec:
    """Return the serializer of a kind of controller; of one without, its arrays as they are."""
    kind = known_controller(controller)
    return _made(kind) if kind and kind.serializer else PlainCodec()


@functools.cache
def _made(kind: ControllerKind) -> Codec:
    made: Codec = kind.part("serializer")()
    return made
