"""Serializers: how each kind of genome is written in readable form and read again.

A genome is a set of named arrays; evolution, checkpoints and the champion's file need no more.
The controller defines their shapes and names.
"""

import functools
from collections.abc import Mapping
from typing import Any, Protocol, TypeVar

import numpy as np
from typing_extensions import override

from mjxgait.creature import Creature
from mjxgait.errors import UserError
from mjxgait.kinds import ControllerKind, known_controller

Genome = Mapping[str, np.ndarray]
Settings = TypeVar("Settings")


class Serializer(Protocol[Settings]):
    """Serializer between the arrays of a kind of genome and their form in `champion.json`."""

    def settled(self, genome: Genome, creature: Creature) -> dict[str, np.ndarray]:
        """Return the arrays of a champion as its file will give them back."""
        ...

    def document(self, genome: Genome, settings: Settings, creature: Creature) -> dict[str, Any]:
        """Return the readable form of a genome."""
        ...

    def genome(self, document: Mapping[str, Any], creature: Creature) -> dict[str, np.ndarray]:
        """Return the arrays of a document.

        Raises:
          KeyError, TypeError, ValueError: it is not of this kind.
        """
        ...

    def settings(self, table: Mapping[str, object], where: str) -> Settings:
        """Return the controller's settings from a table of the file `where`."""
        ...

    def check(self, genome: Genome, creature: Creature) -> None:
        """Refuse numbers that no joint can follow.

        Raises:
          UserError: names the first.
        """
        ...

    def shapes(self, settings: Settings, creature: Creature) -> dict[str, tuple[int, ...]]:
        """Return the array shapes that the settings determine."""
        ...

    def embodied(
        self, genome: Genome, settings: Settings, task: str, creature: Creature
    ) -> Creature:
        """Return the body that the genome grows into; the creature itself where none grows."""
        ...


class PlainSerializer(Serializer[Settings]):
    """Implementation of `Serializer`.

    Arrays as nested lists under their names. Other serializers inherit from it.
    """

    @override
    def settled(self, genome: Genome, creature: Creature) -> dict[str, np.ndarray]:
        return dict(genome)

    @override
    def document(self, genome: Genome, settings: Settings, creature: Creature) -> dict[str, object]:
        return {name: np.asarray(array, float).tolist() for name, array in genome.items()}

    @override
    def genome(self, document: Mapping[str, Any], creature: Creature) -> dict[str, np.ndarray]:
        return {name: np.array(values, float) for name, values in document.items()}

    def settings(self, table: Mapping[str, object], where: str) -> Any:
        """The table unparsed; it is parsed where the controller is available."""
        return dict(table)

    @override
    def check(self, genome: Genome, creature: Creature) -> None:
        for name, array in genome.items():
            if not np.isfinite(array).all():
                raise UserError(
                    f"the genome's {name} has numbers that are not finite: this champion cannot "
                    "move; take one of another generation"
                )

    @override
    def shapes(self, settings: Settings, creature: Creature) -> dict[str, tuple[int, ...]]:
        return {}

    @override
    def embodied(
        self, genome: Genome, settings: Settings, task: str, creature: Creature
    ) -> Creature:
        return creature


def serializer_of(controller: str) -> Serializer:
    """Return the serializer of a kind of controller; the default one if it has none."""
    kind = known_controller(controller)
    return _made(kind) if kind and kind.serializer else PlainSerializer()


@functools.cache
def _made(kind: ControllerKind) -> Serializer:
    made: Serializer = kind.part("serializer")()
    return made
