"""Acceptance criteria for hopping: reach the goal, wherever it is, and stay."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_most
from mjxgait.certification.describe import worst_overlap
from mjxgait.certification.tasks.staying import to_the_end
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.hop.goal_criteria import GoalDemands
from mjxgait.tasks.hop.thresholds import HopConfig


class HopDemands(GoalDemands):
    """See `Demands`.

    worth: not all trials, because an episode is shorter than the certification, and a slow hopper
      may still reach a far goal in time.
    """

    worth: float = 0.6
    verdict = "it gets to its goal and stays"
    share = "share that arrives and stays"

    def wanted(self, config: CertificateConfig) -> HopConfig:
        """See `GoalDemands`."""
        return config.hop

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that stayed up, arrived, and stayed there."""
        wanted = self.wanted(config)
        frames = frames_in(wanted.stay, outcome.trajectory.time_step)
        left = away(starts.goal[:, None], outcome.path, outcome.aside)
        return outcome.stayed_up & (farthest(left, starts.goal, frames) <= wanted.near)

    def lost(self, outcome: Outcome, starts: Starts, steps: int) -> np.ndarray:
        """See `Demands`: down, or away from the goal at a time that counts."""
        wanted = self.wanted(CertificateConfig())
        frames = frames_in(wanted.stay, outcome.trajectory.time_step)
        due = slice(outcome.path.shape[1] - frames, steps)
        goal = starts.goal[:, None]
        outside = away(goal, outcome.path[:, due], outcome.aside[:, due]) > wanted.near * goal
        return super().lost(outcome, starts, steps) | outside.any(1)

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, Any]:
        """See `Demands`: distance from the goal at the end, and time of the final arrival."""
        left = _left(whole)
        outside = np.flatnonzero(~(left <= self.wanted(config).near * whole.goal))
        begins = outside[-1] + 1 if len(outside) else 0
        arrival = float(begins * whole.time_step) if begins < len(left) else None
        when = f"there from {arrival:.2f} s on" if arrival is not None else "not there"
        return {
            "goal": whole.goal,
            "left": float(left[-1]),
            "arrival": arrival,
            "overlap": worst_overlap(whole),
            "summary": f"{left[-1]:.3f} m from a goal {whole.goal:g} m ahead, {when}",
        }

    def second(self, whole: Recording, config: CertificateConfig) -> Criterion:
        """See `GoalDemands`: it arrives and stays."""
        wanted = self.wanted(config)
        frames = frames_in(wanted.stay, whole.time_step)
        left = farthest(_left(whole)[None], np.array([whole.goal]), frames)[0]
        there = at_most("farthest left / goal distance", left, wanted.near)
        return Criterion(2, "arrives and stays", (there,))

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """See `Demands`: no early end, and near the goal at the end."""
        near: np.ndarray = outcome["off"] <= self.wanted(CertificateConfig()).near
        return to_the_end(outcome, seconds, creature) & near


def away(goal: np.ndarray, path: np.ndarray, aside: np.ndarray) -> np.ndarray:
    """Distance in m to a goal that lies straight ahead of the start, measured in the plane.

    Args:
      goal: m ahead of the start. path, aside: m forward and to the left, at each moment.
    """
    distance: np.ndarray = np.hypot(goal - path, aside)
    return distance


def _left(whole: Recording) -> np.ndarray:
    """Distance [T] in m from the trunk to the goal."""
    ahead, aside, _ = whole.trunk_pos.T
    return away(np.array(whole.goal), ahead, aside)


def farthest(left: np.ndarray, goal: np.ndarray, frames: int) -> np.ndarray:
    """Largest distance [S] to the goal over the last frames, in goal distances; NaN if one is NaN.

    Args:
      left: [S, T] m. goal: [S] m.
    """
    last: np.ndarray = left[:, -frames:].max(1) / goal
    return last


def frames_in(seconds: float, time_step: float) -> int:
    """Number of frames in this time, at least one."""
    return max(round(seconds / time_step), 1)
