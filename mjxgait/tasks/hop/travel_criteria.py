"""Acceptance criteria for travelling from goal to goal: advance, and do not stop."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification.buzz import buzz
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least, at_most
from mjxgait.certification.describe import worst_overlap
from mjxgait.certification.tasks.staying import to_the_end
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.hop.goal_criteria import GoalDemands
from mjxgait.tasks.hop.thresholds import TravelConfig

NEAR = 0.05
"""Share of the goal spacing within which a goal counts as reached (docs/hop.md)."""


class TravelDemands(GoalDemands):
    """See `Demands`. A goal that is near, or passed, moves on by its first distance."""

    verdict = "it travels from goal to goal"
    share = "share that travels"
    revision = 1
    """A criterion for vibration was added."""

    def wanted(self, config: CertificateConfig) -> TravelConfig:
        """See `GoalDemands`."""
        return config.travel

    def onward(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """See `Demands`."""
        reached = goal - way <= NEAR * first
        return np.where(reached, goal + first, goal)

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that stayed up and were fast enough."""
        seconds = outcome.path.shape[1] * outcome.trajectory.time_step
        return outcome.stayed_up & (outcome.path[:, -1] >= config.travel.speed * seconds)

    def second(self, whole: Recording, config: CertificateConfig) -> Criterion:
        """See `GoalDemands`: fast enough, and not much slower in the second half."""
        wanted = config.travel
        way = whole.trunk_pos[:, 0]
        half, seconds = len(way) // 2, len(way) * whole.time_step
        kept = (way[-1] - way[half]) / way[half] if way[half] > 0 else np.nan
        return Criterion(
            2,
            "travels",
            (
                at_least("speed (m/s)", way[-1] / seconds, wanted.speed),
                at_least("second half's speed / first", kept, wanted.second_half, 1.0),
            ),
        )

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: as for all tasks with a goal, and 7: no motion by vibration."""
        shakes = at_most("buzz of a joint / joint speed", buzz(whole), config.gait.buzz)
        return (*super().undisturbed(whole, halved, config), Criterion(7, "gait", (shakes,)))

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """See `Demands`: distance travelled, and number of goals."""
        way, goal, goals = whole.trunk_pos[:, 0], np.array(whole.goal), 0
        for place in np.maximum.accumulate(way):
            ahead = self.onward(goal, np.array(whole.goal), place)
            goals, goal = goals + int(ahead > goal), ahead
        seconds = len(way) * whole.time_step
        return {
            "goal": whole.goal,
            "goals": goals,
            "way": float(way[-1]),
            "overlap": worst_overlap(whole),
            "summary": f"{way[-1]:.2f} m and {goals} goals in {seconds:g} s",
        }

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """See `Demands`: no early end, and fast enough."""
        fast: np.ndarray = outcome["way"] >= CertificateConfig().travel.speed * seconds
        return to_the_end(outcome, seconds, creature) & fast
