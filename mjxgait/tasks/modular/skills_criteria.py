"""Acceptance criteria of bodies with several skills; plain simulations show the first skill.

`certification.skills` examines every skill by the criteria of its own task.
"""

from collections.abc import Mapping

import numpy as np
from typing_extensions import override

from mjxgait.certification.acceptance import acceptance_of
from mjxgait.creature import Creature
from mjxgait.kinds import skills_of
from mjxgait.tasks.modular.criteria import SwimCriteria


class SkillsCriteria(SwimCriteria):
    """Implementation of `AcceptanceCriteria`.

    task: one with skills, of which swimming is first. each: the criteria of the skills, in their
    order.
    """

    def __init__(self, task: str, verdict: str) -> None:
        self.each = tuple(map(acceptance_of, skills_of(task)))
        self.verdict = verdict
        self.revision = sum(one.revision for one in self.each)

    @override
    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """All trials or none: each skill must be worth validating by its own trials."""
        count = len(self.each)
        trials = len(outcome["seconds"])
        worth = [
            one.managed({n: a[k::count] for n, a in outcome.items()}, seconds, creature).mean()
            >= one.worth
            for k, one in enumerate(self.each)
        ]
        return np.full(trials, all(worth))


def amphibian() -> SkillsCriteria:
    """Return the criteria of a body that swims and walks."""
    return SkillsCriteria("amphibian", "it swims and walks")


def all_trades() -> SkillsCriteria:
    """Return the criteria of a body that also jumps and follows a light."""
    return SkillsCriteria("all-trades", "it swims, walks, jumps and follows a light")
