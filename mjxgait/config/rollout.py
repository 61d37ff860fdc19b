"""How individuals are judged, as frozen dataclasses."""

import dataclasses
from typing import Annotated, Literal

import pydantic

from mjxgait.config.tables import (
    HOST,
    KIND,
    SHAPE,
    STRICT,
    Count,
    Fraction,
    NonNegative,
    Positive,
    Share,
    Whole,
)
from mjxgait.creature.ground.spec import FLAT, check_ground

Physics = Literal["auto", "mjx"]
GroundText = Annotated[str, pydantic.AfterValidator(check_ground)]


@dataclasses.dataclass(frozen=True)
class TerminationConfig:
    """What ends an episode early; a key that is not given is as creature.toml has it.

    Attributes:
      min_up: cosine of the trunk's tilt below which it has tipped over; -1 never ends an
        episode.
      height: lowest and highest trunk height, in standing heights.
      touch: whether an episode ends when a part touches the floor that must not. Only then
        may evolution leave out the contacts of these parts.
    """

    __pydantic_config__ = STRICT
    min_up: Annotated[Annotated[float, pydantic.Field(ge=-1, le=1)] | None, SHAPE] = None
    height: Annotated[tuple[NonNegative, Positive] | None, SHAPE] = None
    touch: Annotated[bool | None, SHAPE] = None

    def __post_init__(self) -> None:
        if self.height is not None and self.height[0] >= self.height[1]:
            raise ValueError(f"height = {list(self.height)}: the first must be the smaller")


@dataclasses.dataclass(frozen=True)
class RolloutConfig:
    """How individuals are judged.

    Attributes:
      seconds: length of an episode.
      starts: R, episodes per individual; the first is nominal, the others are perturbed, the
        same for all.
      promote: share of a generation, those who do best in the first start, that is tried in the
        others too; the rest is dropped. 1 tries everybody in all.
      step: s of the simulation, of bodies that grow; 0 takes that of creature.xml.
      variety: so many times as many perturbed starts there are in all; each generation takes
        the next ones. With more than 1 everybody must be judged anew: `evolution.elite`.
      joint_noise: rad; half width of the uniform perturbation of each joint at a perturbed
        start.
      velocity_noise: rad/s; the same for the speeds of the joints.
      friction: range of the factor on the floor's friction.
      push: sudden change of the trunk's horizontal velocity at a random moment of a perturbed
        start, in units of sqrt(g * hip height).
      gains: half width of the uniform change of each joint's kp and kd in a perturbed start,
        as a share.
      masses: the same for each part's mass and inertia, which then differ from lane to lane;
        a step costs a third more (docs/performance.md).
      latency: most control steps by which the torques of a perturbed start come late.
      slope: deg; the ground of a perturbed start slopes by so much at most, to any side. Not with a
        `ground`, which all starts have.
      rough: hip heights; that ground rises and falls by so much besides.
      terminate: whether an episode ends when the creature falls; if not, its whole body meets
        the floor.
      termination: what counts as falling, where it differs from creature.toml.
      worst: share of the worst start in the score; the mean of the starts has the rest.
      caution: standard errors of its starts' mean by which the score is less: who was lucky on few
        is not believed as one that did well on many.
      physics: auto takes this program's own step, and MJX for a model that it does not know; mjx
        always takes MJX. Both give the same motion within tolerances (docs/performance.md).
      lanes: simulations in flight per device; 0 lets the program choose.
      block: individuals that a machine of a cluster judges at once, at most (docs/cluster.md).
      body: its numbers are constants of the compiled program, which is faster, or inputs:
        then another body of the same make-up needs no compilation.
      ground: flat, slope:0.1, steps:0.05, bumps:0.05 or rough:0.05, in hip heights
        (docs/ground.md).
    """

    __pydantic_config__ = STRICT
    seconds: Annotated[Positive, SHAPE] = 8.0
    starts: Annotated[Count, SHAPE] = 3
    promote: Annotated[Share, SHAPE] = 0.25
    step: Annotated[NonNegative, SHAPE] = 0.0
    variety: Annotated[Count, SHAPE] = 1
    joint_noise: NonNegative = 0.1
    velocity_noise: NonNegative = 0.3
    friction: tuple[Positive, Positive] = (0.8, 1.2)
    push: NonNegative = 0.2
    gains: Fraction = 0.1
    masses: Annotated[Fraction, SHAPE] = 0.0
    latency: Annotated[Whole, SHAPE] = 0
    slope: Annotated[float, pydantic.Field(ge=0, le=45), SHAPE] = 0.0
    rough: Annotated[float, pydantic.Field(ge=0, le=0.5), SHAPE] = 0.0
    terminate: Annotated[bool, SHAPE] = True
    termination: TerminationConfig = dataclasses.field(default_factory=TerminationConfig)
    worst: Fraction = 0.5
    caution: Annotated[NonNegative, SHAPE] = 0.0
    physics: Annotated[Physics, SHAPE] = "auto"
    lanes: Annotated[Whole, SHAPE] = 0
    block: Annotated[Count, HOST] = 64
    ground: Annotated[GroundText, KIND] = FLAT
    body: Annotated[Literal["constants", "inputs"], SHAPE] = "constants"

    def __post_init__(self) -> None:
        if self.uneven and self.ground != FLAT:
            raise ValueError(
                f"ground = {self.ground}: all starts have it; slope and rough are for a flat one"
            )

    @property
    def promotes(self) -> bool:
        """Whether not everybody is tried in all starts."""
        return self.promote < 1 and self.starts > 1

    @property
    def uneven(self) -> bool:
        """Whether perturbed starts have uneven ground of their own."""
        return bool(self.slope or self.rough)
