"""Settings of a run, as frozen dataclasses."""

import dataclasses
from typing import Annotated, Literal

import pydantic

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.tables import (
    ADDED,
    HOST,
    KIND,
    SHAPE,
    STRICT,
    Count,
    Finite,
    Fraction,
    NonNegative,
    Positive,
    Seed,
    Share,
    Whole,
)
from mjxgait.controllers.config import DriveConfig
from mjxgait.controllers.key_poses.config import PoseConfig
from mjxgait.creature.ground.spec import FLAT, check_ground
from mjxgait.tasks.walk.config import WalkConfig

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
      hold: generations that have the same perturbed starts, before the next ones come.
      moves: s; time at which the lights of the perturbed starts change places, for tasks that
        follow one; 0 for never.
      joint_noise: rad; half width of the uniform perturbation of each joint at a perturbed start.
      velocity_noise: rad/s; the same for the speeds of the joints.
      friction: range of the factor on the floor's friction.
      push: sudden change of the trunk's horizontal velocity at a random moment of a perturbed
        start, in units of sqrt(g * hip height).
      gains: half width of the uniform change of each joint's kp and kd in a perturbed start, as a
        share.
      masses: the same for each part's mass and inertia, which then differ from lane to lane; a step
        costs a third more (docs/research/performance.md).
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
        mjx always takes MJX. Both give the same motion within tolerances
        (docs/research/performance.md).
      lanes: simulations in flight per device; 0 lets the program choose.
      block: most individuals that a machine of a cluster evaluates at once (docs/guide/cluster.md).
      body: its parameters are constants of the compiled program, which is faster, or inputs: then
        another body of the same topology needs no compilation.
      ground: flat, slope:0.1 (rise per metre), or steps:0.05, bumps:0.05, rough:0.05 (hip heights);
        docs/reference/ground.md.
    """

    __pydantic_config__ = STRICT
    seconds: Annotated[Positive, SHAPE] = 8.0
    starts: Annotated[Count, SHAPE] = 3
    promote: Annotated[Share, SHAPE] = 0.25
    step: Annotated[NonNegative, SHAPE] = 0.0
    variety: Annotated[Count, SHAPE] = 1
    hold: Annotated[Count, ADDED] = 1
    moves: Annotated[NonNegative, ADDED] = 0.0
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
        """Return whether only a share of the individuals runs all starts."""
        return self.promote < 1 and self.starts > 1

    @property
    def uneven(self) -> bool:
        """Return whether perturbed starts have uneven ground of their own."""
        return bool(self.slope or self.rough)


@dataclasses.dataclass(frozen=True)
class ExaminationConfig:
    """Choice of the champion for the final examination in C MuJoCo.

    Attributes:
      every: generations between checks of the best during the run, if it is promising; 0 examines
        only after the last generation.
      enough: margin on the selection draw that leads to an examination in the first half of the
        generations; in the second any pass does.
      draws: perturbed starts, and as many pushes, for selection; the examination draws others.
      caution: standard errors subtracted from the shares on that draw: the champion selected by
        them is often a lucky one.
      attempts: examinations of a run, the final one included.
      candidates: number of the best, different from each other, validated at the end, until one has
        enough margin; 0 leaves all examinations out.
      on_the_way: number of them validated during the run. With few starts in each generation the
        first is often the luckiest.
      tryout: starts on which all candidates run in evolution's physics before one is validated, the
        best first; 0 takes them by their fitness.
      difference: in units of each gene's range (of programs and brains, of their raw values), root
        mean square; what counts as different.
      level: what ends a run early: a walk that passes the certificate, or one that walks anywhere
        (docs/reference/certificate.md).
    """

    __pydantic_config__ = STRICT
    every: Annotated[Whole, HOST] = 5
    enough: Annotated[Finite, HOST] = 0.2
    draws: Annotated[Count, HOST] = 32
    caution: Annotated[NonNegative, HOST] = 0.0
    attempts: Annotated[Count, HOST] = 3
    candidates: Annotated[Whole, HOST] = 12
    on_the_way: Annotated[Count, HOST] = 1
    tryout: Annotated[Whole, HOST] = 0
    difference: Annotated[NonNegative, HOST] = 0.02
    level: Annotated[Literal["walks", "anywhere"], HOST] = "walks"


@dataclasses.dataclass(frozen=True)
class UseConfig:
    """Controller and task of a run.

    Attributes:
      controller: what moves the creature: poses, program (docs/reference/expressions.md), network
        (docs/reference/network.md), brain (docs/reference/modular-bodies.md), or FILE.py:CLASS of
        your own (docs/guide/your-own-task.md).
      task: what the creature is to do: walk, turn, hop, limbo, travel; swim, walk, jump, follow,
        follow-on-land, compete, amphibian and all-trades of bodies that grow
        (docs/reference/modular-bodies.md); or FILE.py:CLASS of your own.
    """

    __pydantic_config__ = STRICT
    controller: Annotated[str, SHAPE] = "poses"
    task: Annotated[str, SHAPE] = "walk"


@dataclasses.dataclass(frozen=True)
class Config:
    """Settings of a run.

    Attributes:
      seed: Random seed.
      checkpoint_every: Generations between checkpoints, the most that a killed run loses; the
        latest three stay.
      keep_every: Checkpoints of generations that are a multiple of this are kept for good.
      use: Controller and task.
      controller: Controller settings.
      drive: Motor settings.
      rollout: Evaluation of individuals.
      fitness: Fitness terms and their weights.
      evolution: The search: a genetic algorithm, or an evolution strategy.
      examination: Choice of the champion to examine.
    """

    __pydantic_config__ = STRICT
    seed: Annotated[Seed, HOST] = 0
    checkpoint_every: Annotated[Count, HOST] = 5
    keep_every: Annotated[Count, HOST] = 5
    use: UseConfig = dataclasses.field(default_factory=UseConfig)
    controller: PoseConfig = dataclasses.field(default_factory=PoseConfig)
    drive: DriveConfig = dataclasses.field(default_factory=DriveConfig)
    rollout: RolloutConfig = dataclasses.field(default_factory=RolloutConfig)
    fitness: WalkConfig = dataclasses.field(default_factory=WalkConfig)
    evolution: EvolutionConfig = dataclasses.field(default_factory=EvolutionConfig)
    examination: ExaminationConfig = dataclasses.field(default_factory=ExaminationConfig)

    def __post_init__(self) -> None:
        if self.rollout.variety > 1 and not self.evolution.elite:
            raise ValueError(
                f"rollout.variety = {self.rollout.variety}: individuals evaluated on other "
                'starts do not compare; set evolution.survival = "children" and evolution.elite'
            )

    @property
    def wish(self) -> dict[str, float | str]:
        """Walk targets by name that the certificate demands; empty for tasks other than walk."""
        targets = getattr(self.fitness, "wish", None)
        return targets.table if targets is not None and targets.binding else {}
