"""Everything a run can be told, as frozen dataclasses."""

import dataclasses
from typing import Annotated, Literal

from mjxgait.config.evolution import EvolutionConfig
from mjxgait.config.rollout import RolloutConfig
from mjxgait.config.tables import (
    HOST,
    SHAPE,
    STRICT,
    Count,
    Finite,
    NonNegative,
    Whole,
)
from mjxgait.controllers.key_poses.config import DriveConfig, PoseConfig
from mjxgait.tasks.walk.config import WalkConfig


@dataclasses.dataclass(frozen=True)
class ExaminationConfig:
    """Who is chosen for the examination in C MuJoCo that ends a run.

    Attributes:
      every: generations between looks on the way at the best, if it is promising; 0 examines only
        after the last generation.
      enough: margin on the draw to choose on that leads to an examination in the first half of the
        generations; in the second any pass does.
      draws: perturbed starts, and as many pushes, to choose on; the examination draws others.
      caution: standard errors by which the shares on that draw count less: the champion that is
        chosen by them is often a lucky one.
      attempts: examinations of a run, the one at its end included.
      candidates: so many of the best, different from each other, are looked at in the end, until
        one has enough margin; 0 leaves all examinations out.
      on_the_way: so many of them are looked at on the way. With few starts in each generation the
        first is often the luckiest.
      tryout: so many starts on which all candidates are tried in evolution's physics before one is
        looked at, the best first; 0 takes them by their fitness.
      difference: in units of each gene's range, root mean square; what counts as different.
      level: what ends a run early: one that walks by the certificate, or that walks anywhere
        (docs/certificate.md).
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
    """Who takes part.

    Attributes:
      controller: what moves the creature: poses, program (docs/programs.md), brain
        (docs/blocks.md), or FILE.py:CLASS of your own (docs/extending.md).
      task: what the creature is to do: walk, hop, limbo, travel; swim, walk, jump, follow and
        follow-on-land of bodies that grow (docs/blocks.md); or FILE.py:CLASS of your own.
    """

    __pydantic_config__ = STRICT
    controller: Annotated[str, SHAPE] = "poses"
    task: Annotated[str, SHAPE] = "walk"


@dataclasses.dataclass(frozen=True)
class Config:
    """A run's settings.

    Attributes:
      seed: Of all randomness.
      checkpoint_every: Generations between checkpoints, which is what a killed run loses at
        most; the latest three stay.
      keep_every: Checkpoints of generations that are a multiple of this are kept for good.
      use: Who takes part.
      controller: What moves the creature.
      drive: How the joints' motors follow.
      rollout: How individuals are judged.
      fitness: What is wanted of them.
      evolution: The genetic algorithm.
      examination: Who is examined.
    """

    __pydantic_config__ = STRICT
    seed: Annotated[Whole, HOST] = 0
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
                f"rollout.variety = {self.rollout.variety}: who has been judged on other starts "
                'does not compare; set evolution.survival = "children" and evolution.elite'
            )

    @property
    def wish(self) -> dict[str, float | str]:
        """What is asked of a walk, by name; of who does something else nothing can be."""
        asked = getattr(self.fitness, "wish", None)
        return asked.table if asked is not None else {}
