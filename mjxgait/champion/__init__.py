"""One individual, complete and readable without JAX: `champion.json`."""

from mjxgait.champion.record import (
    Champion,
    DamagedChampion,
    read_champion,
    split_genome,
    write_champion,
)
from mjxgait.champion.serializers import Serializer, serializer_of
from mjxgait.champion.skills import TRIALS, by_skill

__all__ = [
    "TRIALS",
    "Champion",
    "DamagedChampion",
    "Serializer",
    "by_skill",
    "read_champion",
    "serializer_of",
    "split_genome",
    "write_champion",
]
