"""Default serializer: genomes as named arrays."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.creature import Creature
from mjxgait.errors import UserError

Genome = Mapping[str, np.ndarray]


class PlainCodec:
    """See `Codec`: arrays as nested lists under their names. Other serializers inherit from it."""

    def settled(self, genome: Genome, creature: Creature) -> dict[str, np.ndarray]:
        """See `Codec`."""
        return dict(genome)

    def document(self, genome: Genome, settings: Any, creature: Creature) -> dict[str, Any]:
        """See `Codec`."""
        return {name: np.asarray(array, float).tolist() for name, array in genome.items()}

    def genome(self, document: Mapping[str, Any], creature: Creature) -> dict[str, np.ndarray]:
        """See `Codec`."""
        return {name: np.array(values, float) for name, values in document.items()}

    def settings(self, table: Mapping[str, Any], where: str) -> Any:
        """See `Codec`: the table unparsed; it is parsed where the controller is available."""
        return dict(table)

    def check(self, genome: Genome, creature: Creature) -> None:
        """See `Codec`."""
        for name, array in genome.items():
            if not np.isfinite(array).all():
                raise UserError(
                    f"the genome's {name} has numbers that are not finite: this champion cannot "
                    "move; take one of another generation"
                )

    def shapes(self, settings: Any, creature: Creature) -> dict[str, tuple[int, ...]]:
        """See `Codec`."""
        return {}

    def embodied(self, genome: Genome, settings: Any, task: str, creature: Creature) -> Creature:
        """See `Codec`."""
        return creature
