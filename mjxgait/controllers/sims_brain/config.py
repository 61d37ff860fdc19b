"""Settings of creatures whose bodies and brains evolve together."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import (
    SHAPE,
    STRICT,
    Fraction,
    NonNegative,
    Positive,
)
from mjxgait.controllers.key_poses.config import holds

Room = Annotated[int, pydantic.Field(ge=1), SHAPE]


@dataclasses.dataclass(frozen=True)
class BrainConfig:
    """Graphs of blocks with nerves (Sims 1994).

    Attributes:
      nodes: room of a graph.
      connections: room of each node.
      parts: room of a body.
      links: room of a body; a part needs a link per hinge, and at least one.
      local: neurons of each node.
      central: neurons of no node.
      every: control steps from one command to the next; a brain takes two steps of its own
        for each.
      values: how many values change in a mutation, on average.
      sigma: by how much, as a share of their ranges.
      connect: chance of a connection more or less.
      grow: chance of a new node.
      strength: from and to which factor each mutation draws one of its own, all magnitudes alike:
        so many times as many values change, and so much as often, at most as told, a connection
        or a node.
      crossover: share of the offspring of two parents whose nodes are crossed over.
      grafting: share that has a graft of its second parent; the others have one parent.
      drawn: whether bodies stay as they were drawn, and brains alone evolve.
    """

    __pydantic_config__ = STRICT
    nodes: Room = 6
    connections: Room = 3
    parts: Room = 12
    links: Annotated[int, pydantic.Field(ge=2), SHAPE] = 12
    local: Room = 3
    central: Room = 4
    every: Annotated[int, pydantic.AfterValidator(holds), SHAPE] = 4
    values: NonNegative = 8.0
    sigma: Positive = 0.2
    connect: Fraction = 0.5
    grow: Fraction = 0.25
    strength: tuple[Positive, Positive] = (1.0, 1.0)
    crossover: Fraction = 0.3
    grafting: Fraction = 0.3
    drawn: bool = False
