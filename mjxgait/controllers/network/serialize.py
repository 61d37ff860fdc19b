"""Serializer for the weights of a network."""

from collections.abc import Mapping

from typing_extensions import override

from mjxgait.champion.serializers import PlainSerializer
from mjxgait.config.tables import build
from mjxgait.controllers.network.config import NetworkConfig, layers
from mjxgait.creature import Creature


class NetworkSerializer(PlainSerializer[NetworkConfig]):
    """Arrays by name, of the shapes that the settings determine; see `Serializer`."""

    @override
    def settings(self, table: Mapping[str, object], where: str) -> NetworkConfig:
        return build(NetworkConfig, dict(table), where)

    @override
    def shapes(self, settings: NetworkConfig, creature: Creature) -> dict[str, tuple[int, ...]]:
        found: dict[str, tuple[int, ...]] = {}
        for i, shape in enumerate(layers(len(creature.joints.names), settings.hidden)):
            found |= {f"weight_{i}": shape, f"bias_{i}": shape[1:]}
        return found
