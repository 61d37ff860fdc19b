"""Serializer for the weights of a network."""

from collections.abc import Mapping

import numpy as np
from typing_extensions import override

from mjxgait.champion.serializers import PlainSerializer
from mjxgait.config.tables import build
from mjxgait.controllers.network.config import NetworkConfig, layers
from mjxgait.creature import Creature
from mjxgait.errors import UserError


class NetworkSerializer(PlainSerializer[NetworkConfig]):
    """Arrays by name, of the shapes that the settings determine; see `Serializer`."""

    @override
    def settings(self, table: Mapping[str, object], where: str) -> NetworkConfig:
        return build(NetworkConfig, dict(table), where)

    @override
    def check(self, genome: Mapping[str, np.ndarray], creature: Creature) -> None:
        super().check(genome, creature)
        hidden = tuple(len(genome[f"bias_{i}"]) for i in range(len(genome) // 2 - 1))
        for name, shape in self._shapes(hidden, creature).items():
            if name not in genome or genome[name].shape != shape:
                found = genome[name].shape if name in genome else "missing"
                raise UserError(
                    f"the genome's {name} is {found}, and this network's has the shape {shape}; "
                    "take the champion of another generation"
                )

    @override
    def shapes(self, settings: NetworkConfig, creature: Creature) -> dict[str, tuple[int, ...]]:
        return self._shapes(settings.hidden, creature)

    def _shapes(self, hidden: tuple[int, ...], creature: Creature) -> dict[str, tuple[int, ...]]:
        found: dict[str, tuple[int, ...]] = {}
        for i, shape in enumerate(layers(len(creature.joints.names), hidden)):
            found |= {f"weight_{i}": shape, f"bias_{i}": shape[1:]}
        return found
