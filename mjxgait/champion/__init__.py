"""One individual, complete and readable without JAX: `champion.json`."""

from mjxgait.champion.record import (
    Champion,
    DamagedChampion,
    read_champion,
    split_genome,
    write_champion,
)
from mjxgait.champion.serializers import Serializer, serializer_of

__all__ = [
    "Champion",
    "DamagedChampion",
    "Serializer",
    "read_champion",
    "serializer_of",
    "split_genome",
    "write_champion",
]
