"""Acceptance criteria of bodies with several skills: what is simulated is the first skill.

`certification.skills` examines every skill by the criteria of its own task.
"""

from collections.abc import Mapping

import numpy as np
from typing_extensions import override

from mjxgait.creature import Creature
from mjxgait.tasks.modular.criteria import (
    JumpCriteria,
    ModularCriteria,
    RoamCriteria,
    SwimCriteria,
)
from mjxgait.tasks.modular.follow_criteria import in_water


class Amphibian(SwimCriteria):
    """Implementation of `AcceptanceCriteria`. each: the criteria of the skills, in their order."""

    verdict = "it swims and walks"
    worth = 1.0

    def __init__(self) -> None:
        self.each: tuple[ModularCriteria, ...] = (SwimCriteria(), RoamCriteria())
        self.revision = sum(one.revision for one in self.each)

    @override
    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """Each trial as the task of its skill demands; the skills take turns."""
        each = np.array([one.managed(outcome, seconds, creature) for one in self.each])
        trial = np.arange(each.shape[1])
        found: np.ndarray = each[trial % len(each), trial]
        return found


class AllTrades(Amphibian):
    """Implementation of `AcceptanceCriteria`."""

    verdict = "it swims, walks, jumps and follows a light"
    worth = 0.75

    def __init__(self) -> None:
        super().__init__()
        self.each = (*self.each, JumpCriteria(), in_water())
        self.revision = sum(one.revision for one in self.each)
