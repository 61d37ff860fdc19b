"""Settings of the evaluation of individuals, as frozen dataclasses."""

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
    """Conditions that end an episode early; a key that is not given has its value in creature.toml.

    Attributes:
      min_up: cosine of the trunk's tilt below which it has tipped over; -1 never ends an episode.
      height: lowest and highest trunk height, in standing heights.
      touch: ends an episode when a part touches the floor that must not. Only then may evolution
        leave out the contacts of these parts.
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
    """Evaluation of individuals.

    Attributes:
      seconds: length of an episode.
      starts: R, episodes per individual; the first is nominal, the others are perturbed, the same
        for all.
      promote: share of a generation, the best in the first start, that runs the other starts too;
        the rest is dropped. 1 runs all individuals in all starts.
      step: s; simulation step of bodies that grow; 0 takes that of creature.xml.
      variety: multiple of the perturbed starts to draw in all; each generation takes the next ones.
        Above 1 every individual must be evaluated anew: `evolution.elite`.
      joint_noise: rad; half width of the uniform perturbation of each joint at a perturbed start.
      velocity_noise: rad/s; the same for the speeds of the joints.
      friction: range of the factor on the floor's friction.
      push: sudden change of the trunk's horizontal velocity at a random moment of a perturbed
        start, in units of sqrt(g * hip height).
      gains: half width of the uniform change of each joint's kp and kd in a perturbed start, as a
        share.
      masses: the same for each part's mass and inertia, which then differ from lane to lane; a step
        costs a third more (docs/performance.md).
      latency: most control steps by which the torques of a perturbed start are delayed.
      slope: deg; largest slope of the ground in a perturbed start, to any side. Not with a
        `ground`, which all starts have.
      rough: hip heights; largest rise and fall of that ground, on top of the slope.
      terminate: ends an episode when the creature falls; otherwise its whole body collides with the
        floor.
      termination: definition of a fall, where it differs from creature.toml.
      worst: share of the worst start in the score; the mean of the starts has the rest.
      caution: standard errors of its starts' mean subtracted from the score: discounts luck on few
        starts.
      physics: auto takes this program's own step, and MJX for a model outside that step's scope;
        mjx always takes MJX. Both give the same motion within tolerances (docs/performance.md).
      lanes: simulations in flight per device; 0 lets the program choose.
      block: most individuals that a machine of a cluster evaluates at once (docs/cluster.md).
      body: its parameters are constants of the compiled program, which is faster, or inputs: then
        another body of the same topology needs no compilation.
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
        """Tell whether only a share of the individuals runs all starts."""
        return self.promote < 1 and self.starts > 1

    @property
    def uneven(self) -> bool:
        """Tell whether perturbed starts have uneven ground of their own."""
        return bool(self.slope or self.rough)
