"""Settings of islands: several populations of one run that exchange their best."""

import dataclasses
from typing import Annotated, Literal

from mjxgait.config.tables import (
    HOST,
    STRICT,
    Count,
    Whole,
)


@dataclasses.dataclass(frozen=True)
class IslandsConfig:
    """Separate populations, each of the whole `population`, on the same starts.

    Attributes:
      count: number of islands; 1 is the plain algorithm.
      every: generations between exchanges; 0: none.
      migrants: best individuals of an island, copied over the worst of another; of all that reach
        an island the best stay, at most half its population.
      topology: where they go: to the next island of the ring, or to all the others.
    """

    __pydantic_config__ = STRICT
    count: Annotated[Count, HOST] = 1
    every: Annotated[Whole, HOST] = 5
    migrants: Annotated[Count, HOST] = 2
    topology: Annotated[Literal["ring", "all"], HOST] = "ring"

    def sources(self, island: int) -> list[int]:
        """Return the islands that send migrants to an island."""
        if self.topology == "ring":
            return [(island - 1) % self.count] if self.count > 1 else []
        return [other for other in range(self.count) if other != island]
