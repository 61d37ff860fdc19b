"""Settings of a run, as frozen dataclasses."""

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
      difference: in units of each gene's range, root mean square; what counts as different.
      level: what ends a run early: a walk that passes the certificate, or one that walks anywhere
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
    """Controller and task of a run.

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
      evolution: The genetic algorithm.
      examination: Choice of the champion to examine.
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
        """Walk targets by name; empty for tasks other than walk."""
        asked = getattr(self.fitness, "wish", None)
        return asked.table if asked is not None else {}
