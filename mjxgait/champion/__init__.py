"""One individual, complete and readable without JAX: `champion.json`."""

from mjxgait.champion.record import (
    Champion,
    DamagedChampion,
    read_champion,
    split_genome,
    write_champion,
)
from mjxgait.champion.serializers import Codec, codec_of

__all__ = [
    "Champion",
    "Codec",
    "DamagedChampion",
    "codec_of",
    "read_champion",
    "split_genome",
    "write_champion",
]
