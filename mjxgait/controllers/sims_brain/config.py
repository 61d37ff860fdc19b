"""Settings of creatures with evolving bodies and brains."""

import dataclasses
from typing import Annotated, Literal

import pydantic

from mjxgait.config.tables import (
    ADDED,
    SHAPE,
    STRICT,
    Fraction,
    NonNegative,
    Positive,
)
from mjxgait.controllers.config import check_every

Room = Annotated[int, pydantic.Field(ge=1), SHAPE]
Graft = Literal["root", "any"]
CentreOf = Literal["mother", "either"]


@dataclasses.dataclass(frozen=True)
class BrainConfig:
    """Settings of graphs of blocks with nerves (Sims 1994).

    Attributes:
      nodes: most nodes of a graph.
      connections: most connections of a node.
      parts: most parts of a body.
      links: most links of a body; a part needs a link per hinge, and at least one.
      small: links up to which a body is simulated by a smaller program with room for just as many,
        because a step takes as long as the room, not the body; 0 simulates all by one program. Sums
        are rounded otherwise, and contacts with the ground amplify that.
      local: neurons of each node.
      children: child parts that a part can hear the neurons of, the first in order of growth. A node
        with 3 connections has 6 child parts at most, for each may grow a mirrored pair.
      central: neurons of no node.
      every: control steps per command; a brain takes two steps of its own per command.
      values: number of values that change in a mutation, on average.
      sigma: size of these changes, as a share of the range.
      connect: chance of adding or removing a connection.
      grow: chance of a new node.
      resize: chance of multiplying all sizes of the body by one factor, log-normally distributed
        with spread `sigma`; ours, not Sims'.
      strength: range of a factor that each mutation draws, log-uniformly; it multiplies the number
        of values that change and, up to 1, the chances `connect` and `grow`.
      crossover: share of two-parent offspring with crossed nodes.
      grafting: share with a graft of the second parent; the others have one parent.
      graft: node of the second parent that a graft attaches, with all that it reaches: "root" for
        the first, "any" for any connected one, all equally likely.
      centre: parent that gives the central neurons of crossed and grafted offspring; "either"
        takes all of one parent, both equally likely.
      evolves: what offspring may inherit changed. "brain": bodies stay as first drawn. "steering":
        only the weights of `steer` change.
      steer: whether the light's direction also acts on each hinge directly, past the neurons; ours,
        not Sims'.
      collide: whether the blocks of a body push each other in evolution, unless a single joint is
        between them; otherwise they pass through each other. The examination always collides them.
      touch: whether contact sensors answer to other blocks of the body, too, also in water; needs
        `collide`.
      skills: effectors of each hinge, one for every skill of the task; they share body and neurons.
      skill: number of the effectors that act where the task does not choose them.
    """

    __pydantic_config__ = STRICT
    nodes: Room = 6
    connections: Room = 3
    parts: Room = 12
    links: Annotated[int, pydantic.Field(ge=2), SHAPE] = 12
    small: Annotated[int, pydantic.Field(ge=0), SHAPE, ADDED] = 0
    local: Room = 3
    children: Annotated[Room, ADDED] = 1
    central: Room = 4
    every: Annotated[int, pydantic.AfterValidator(check_every), SHAPE] = 4
    values: NonNegative = 8.0
    sigma: Positive = 0.2
    connect: Fraction = 0.5
    grow: Fraction = 0.25
    resize: Annotated[Fraction, ADDED] = 0.0
    strength: tuple[Positive, Positive] = (1.0, 1.0)
    crossover: Fraction = 0.3
    grafting: Fraction = 0.3
    graft: Annotated[Graft, SHAPE, ADDED] = "root"
    centre: Annotated[CentreOf, SHAPE, ADDED] = "mother"
    evolves: Annotated[Literal["all", "brain", "steering"], ADDED] = "all"
    steer: Annotated[bool, SHAPE, ADDED] = False
    collide: Annotated[bool, SHAPE, ADDED] = False
    touch: Annotated[bool, SHAPE, ADDED] = False
    skills: Annotated[Room, ADDED] = 1
    skill: Annotated[int, pydantic.Field(ge=0), SHAPE, ADDED] = 0

    def __post_init__(self) -> None:
        if self.evolves == "steering" and not self.steer:
            raise ValueError('evolves = "steering" needs steer = true')
        if self.touch and not self.collide:
            raise ValueError("touch = true needs collide = true")
        if self.skill >= self.skills:
            raise ValueError(f"skill = {self.skill} needs skills = {self.skill + 1} or more")
