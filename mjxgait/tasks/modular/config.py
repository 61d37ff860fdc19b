"""Settings of the tasks for modular bodies."""

import dataclasses
from typing import Annotated

import pydantic

from mjxgait.config.tables import ADDED, STRICT, NonNegative, Positive


@dataclasses.dataclass(frozen=True)
class ModularConfig:
    """Parameters common to these tasks.

    Attributes:
      settle: s from the start that do not count.
      overlap: depth of blocks in each other or in the ground, over the smaller one's size, at which
        half of the performance counts.
      apart: generations until that counts in full; 0: from the first on.
    """

    __pydantic_config__ = STRICT
    settle: NonNegative = 2.0
    overlap: Positive = 0.05
    apart: NonNegative = 0.0


@dataclasses.dataclass(frozen=True)
class SwimWeights:
    """Weight of each term; all but `speed` are penalties.

    Attributes:
      speed: m/s, in a straight line.
      overlap: part of the speed lost by blocks in each other.
      elsewhere: part of the rest lost by momentum that the water did not give.
      curve: part of the rest lost by a way that turns: 1 less the cosine between its halves. A
        follower of a light loses nothing.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 1.0
    overlap: NonNegative = 1.0
    elsewhere: NonNegative = 1.0
    curve: Annotated[NonNegative, ADDED] = 0.0


@dataclasses.dataclass(frozen=True)
class SwimConfig(ModularConfig):
    """Parameters of the swim fitness.

    Attributes:
      elsewhere: share of the momentum that the water did not give, at which half of the speed
        counts: a step of finite length gives some to swimmers that exploit it.
      weights: weight of each term.
    """

    __pydantic_config__ = STRICT
    elsewhere: Positive = 0.02
    weights: SwimWeights = dataclasses.field(default_factory=SwimWeights)


@dataclasses.dataclass(frozen=True)
class RoamWeights:
    """Weight of each term; all but `speed` are penalties.

    Attributes:
      speed: m/s over ground, in a straight line.
      overlap: part of the speed lost by blocks in each other or in the ground.
      balance: part of the rest lost by tipping over.
      vibration: part of the rest lost by joints that vibrate.
      curve: part of the rest lost by a way that turns, as of swimmers.
    """

    __pydantic_config__ = STRICT
    speed: NonNegative = 1.0
    overlap: NonNegative = 1.0
    balance: NonNegative = 1.0
    vibration: Annotated[NonNegative, ADDED] = 0.0
    curve: Annotated[NonNegative, ADDED] = 0.0


@dataclasses.dataclass(frozen=True)
class RoamConfig(ModularConfig):
    """Parameters of the roam fitness.

    Attributes:
      tilt: deg, largest tilt of the root from its settled attitude, at which half of the speed
        counts.
      vibration: change of the joints' speeds from step to step, over these speeds (root mean
        squares), at which half of the speed counts. A joint that swings f times a second has
        2 sin(pi f step).
      weights: weight of each term.
    """

    __pydantic_config__ = STRICT
    apart: NonNegative = 10.0
    tilt: Positive = 45.0
    vibration: Annotated[Positive, ADDED] = 0.8
    weights: RoamWeights = dataclasses.field(default_factory=RoamWeights)


@dataclasses.dataclass(frozen=True)
class JumpWeights:
    """Weight of each term; all but `height` are penalties.

    Attributes:
      height: m, of the lowest part at the best moment, mean of the spans of the time that counts.
      overlap: part of it lost by blocks in each other or in the ground.
      wild: part of the rest lost by an episode that ends early: the share of the time that is
        missing.
    """

    __pydantic_config__ = STRICT
    height: NonNegative = 1.0
    overlap: NonNegative = 1.0
    wild: NonNegative = 1.0


@dataclasses.dataclass(frozen=True)
class JumpConfig(ModularConfig):
    """Parameters of the jump fitness.

    Attributes:
      weights: weight of each term.
    """

    __pydantic_config__ = STRICT
    overlap: Positive = 0.035
    weights: JumpWeights = dataclasses.field(default_factory=JumpWeights)


@dataclasses.dataclass(frozen=True)
class CompeteWeights:
    """Weight of each term; all but `share` are penalties.

    Attributes:
      share: opponent's distance from the cube over the sum of both distances, mean over the time
        that counts.
      overlap: part of the share lost by blocks in each other or in the ground.
      vibration: part of the rest lost by joints that vibrate.
    """

    __pydantic_config__ = STRICT
    share: NonNegative = 1.0
    overlap: NonNegative = 1.0
    vibration: NonNegative = 1.0


@dataclasses.dataclass(frozen=True)
class CompeteConfig(ModularConfig):
    """Parameters of the compete fitness.

    Attributes:
      settle: s from the start that do not count: the way to the cube.
      vibration: change of the joints' speeds from step to step at which half of the share counts,
        as of walkers.
      weights: weight of each term.
    """

    __pydantic_config__ = STRICT
    settle: NonNegative = 6.0
    vibration: Positive = 0.8
    weights: CompeteWeights = dataclasses.field(default_factory=CompeteWeights)


@dataclasses.dataclass(frozen=True)
class RoamSkillWeights(RoamWeights):
    """Weights of walking as one of several skills: fast walkers vibrate.

    Attributes:
      vibration: as in `RoamWeights`.
    """

    __pydantic_config__ = STRICT
    vibration: Annotated[NonNegative, ADDED] = 1.0


@dataclasses.dataclass(frozen=True)
class RoamSkillConfig(RoamConfig):
    """Parameters of walking as one of several skills.

    Attributes:
      weights: weight of each term.
    """

    __pydantic_config__ = STRICT
    weights: RoamSkillWeights = dataclasses.field(default_factory=RoamSkillWeights)


@dataclasses.dataclass(frozen=True)
class FollowSkillConfig(SwimConfig):
    """Parameters of following as one of several skills.

    Attributes:
      settle: s from the start that do not count: the time to turn.
    """

    __pydantic_config__ = STRICT
    settle: NonNegative = 4.0


@dataclasses.dataclass(frozen=True)
class RequiredScores:
    """What the certificate requires of each skill.

    Attributes:
      swim: m/s.
      roam: m/s.
      jump: m.
      follow: m/s, towards the light.
    """

    __pydantic_config__ = STRICT
    swim: Positive = 0.2
    roam: Positive = 0.2
    jump: Positive = 0.1
    follow: Positive = 0.1


@dataclasses.dataclass(frozen=True)
class SkillsConfig:
    """Parameters of tasks with several skills; `apart` does nothing in them.

    Attributes:
      required: unit of each skill's performance.
      least: performance that scores 0, in these units; 1 unit scores 1, and between and beyond the
        score grows with the logarithm.
      most: performance beyond which the score stays the same.
      swim: parameters of that skill, as of its own task.
      roam: likewise.
      jump: likewise.
      follow: likewise.
    """

    __pydantic_config__ = STRICT
    required: RequiredScores = dataclasses.field(default_factory=RequiredScores)
    least: Annotated[float, pydantic.Field(gt=0, lt=1)] = 0.02
    most: Positive = 1.5
    swim: SwimConfig = dataclasses.field(default_factory=SwimConfig)
    roam: RoamSkillConfig = dataclasses.field(default_factory=RoamSkillConfig)
    jump: JumpConfig = dataclasses.field(default_factory=JumpConfig)
    follow: FollowSkillConfig = dataclasses.field(default_factory=FollowSkillConfig)
