"""Acceptance criteria of the tasks with a goal: hop, limbo, travel."""

import abc
import dataclasses
from collections.abc import Mapping

import numpy as np
from typing_extensions import override

from mjxgait.certification.acceptance import WithoutTargets, to_the_end
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import (
    Criterion,
    at_least,
    at_most,
    failures,
    parts,
    physics,
    steady,
)
from mjxgait.certification.describe import vibration, worst_overlap
from mjxgait.creature import Creature
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Fall, Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.hop.thresholds import (
    GoalThresholds,
    HopThresholds,
    LimboThresholds,
    TravelThresholds,
)

HIGHEST = 1e3
"""Height limit in standing heights: a hopping trunk may be anywhere, but no part may lie."""


class GoalCriteria(WithoutTargets, abc.ABC):
    """Implementation of `AcceptanceCriteria`.

    Pushes decide nothing: in half of a hop the body cannot react.
    """

    by_pushes = False
    share: str
    """Name of the share in criterion 4."""

    @abc.abstractmethod
    def wanted(self, config: CertificateConfig) -> GoalThresholds:
        """Thresholds of this task."""

    @abc.abstractmethod
    def second(self, whole: Recording, config: CertificateConfig) -> Criterion:
        """Criterion 2: progress on the way."""

    def fall(self, config: CertificateConfig) -> Fall:
        """A head or an elbow on the floor, or a base on its edge."""
        return Fall(min_up=self.wanted(config).min_up, height=(0.0, HIGHEST), touch=True)

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """A goal for each simulation without one."""
        wanted = self.wanted(config)
        drawn = wanted.nominal if rng is None else rng.uniform(*wanted.goals, len(starts))
        return dataclasses.replace(starts, goal=np.where(starts.goal > 0, starts.goal, drawn))

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criteria 1 and 2, both at half the time step too, 8, 9; without a warm-up."""
        basic, repeated = (self.basic(each, config) for each in (whole, halved))
        of = " and ".join(str(c.number) for c in basic)
        failed = at_most(f"failures in {of}", failures(*repeated), 0.0)
        return (
            *basic,
            Criterion(6, "half the time step", (failed,)),
            physics(whole, config.physics),
            parts(whole, config.parts),
        )

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criterion 4. The effect of pushes is only reported."""
        share = at_least(self.share, started, self.wanted(config).arrive, 1.0)
        return (Criterion(4, "perturbed starts and other goals", (share,)),)

    def basic(self, whole: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """Criteria of one recording, at any time step: 1 and 2."""
        up = at_least("least upright", whole.trunk_up.min(), self.wanted(config).min_up, 1.0)
        lies = at_most("time on wrong parts", whole.touch.mean(), 0.0)
        return (Criterion(1, "stays up", (up, lies)), self.second(whole, config))


class HopCriteria(GoalCriteria):
    """Implementation of `AcceptanceCriteria`.

    worth: not all trials, because an episode is shorter than the certification, and a slow hopper
      may still reach a far goal in time.
    """

    worth: float = 0.6
    verdict = "it gets to its goal and stays"
    share = "share that arrives and stays"

    @override
    def wanted(self, config: CertificateConfig) -> HopThresholds:
        return config.hop

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations that stayed up, arrived, and stayed there."""
        wanted = self.wanted(config)
        frames = frames_in(wanted.stay, outcome.trajectory.time_step)
        left = away(starts.goal[:, None], outcome.path, outcome.aside)
        return outcome.stayed_up & (farthest(left, starts.goal, frames) <= wanted.near)

    def lost(
        self, outcome: Outcome, starts: Starts, steps: int, config: CertificateConfig
    ) -> np.ndarray:
        """Down, or away from the goal at a time that counts."""
        wanted = self.wanted(config)
        frames = frames_in(wanted.stay, outcome.trajectory.time_step)
        due = slice(outcome.path.shape[1] - frames, steps)
        goal = starts.goal[:, None]
        outside = away(goal, outcome.path[:, due], outcome.aside[:, due]) > wanted.near * goal
        return super().lost(outcome, starts, steps, config) | outside.any(1)

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        """Distance from the goal at the end, and time of the final arrival."""
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
        """Arrive, and stay."""
        wanted = self.wanted(config)
        frames = frames_in(wanted.stay, whole.time_step)
        left = farthest(_left(whole)[None], np.array([whole.goal]), frames)[0]
        there = at_most("farthest left / goal distance", left, wanted.near)
        return Criterion(2, "arrives and stays", (there,))

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """No early end, and near the goal at the end."""
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


ENOUGH = 0.01
"""m; more clearance is no better."""


class LimboCriteria(HopCriteria):
    """Implementation of `AcceptanceCriteria`.

    Goals lie beyond the bar, so arrival implies passing it.
    """

    verdict = "it gets to its goal beneath the bar and stays"

    @override
    def wanted(self, config: CertificateConfig) -> LimboThresholds:
        return config.limbo

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """A goal and a bar for each simulation without one."""
        bar = np.array([config.limbo.place, config.limbo.height])
        given = np.where(np.isfinite(starts.bar), starts.bar, bar)
        return dataclasses.replace(super().aimed(starts, config, rng), bar=given)

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations that stayed up and clear, arrived, and stayed there."""
        clear: np.ndarray = outcome.clearance > config.limbo.clearance
        return super().succeeded(outcome, starts, config) & clear

    def lost(
        self, outcome: Outcome, starts: Starts, steps: int, config: CertificateConfig
    ) -> np.ndarray:
        """Lost hops, and any contact with the bar."""
        touched = outcome.clearance <= config.limbo.clearance
        return super().lost(outcome, starts, steps, config) | touched

    def basic(self, whole: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """Evaluate criteria 1, 2 and 3."""
        least, room = _least(whole), config.limbo.clearance
        clear = at_least("least clearance (m)", least, room, room + ENOUGH)
        return (*super().basic(whole, config), Criterion(3, "clear of the bar", (clear,)))

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        """Report of a hop, and the least clearance."""
        reported = super().report(whole, config)
        least = _least(whole)
        bar = f"a bar {config.limbo.height:g} m high {'cleared' if least > 0 else 'touched'}"
        return reported | {"clearance": least, "summary": f"{reported['summary']}; {bar}"}

    def managed(
        self, outcome: Mapping[str, np.ndarray], seconds: float, creature: Creature
    ) -> np.ndarray:
        """A managed hop that is clear of the bar of the certification.

        The bar in evolution may be lower.
        """
        clear = outcome["bar"] <= CertificateConfig().limbo.height
        return super().managed(outcome, seconds, creature) & clear


def _least(whole: Recording) -> float:
    """Least clearance in m over all frames; NaN if one is NaN, or if none was recorded."""
    return np.nan if whole.clearance is None else float(whole.clearance.min())


NEAR = 0.05
"""Share of the goal spacing within which a goal counts as reached (docs/reference/hop.md)."""


class TravelCriteria(GoalCriteria):
    """Implementation of `AcceptanceCriteria`.

    A goal that is near, or passed, moves on by its first distance.
    """

    verdict = "it travels from goal to goal"
    share = "share that travels"
    revision = 1
    """A criterion for vibration was added."""

    @override
    def wanted(self, config: CertificateConfig) -> TravelThresholds:
        return config.travel

    @override
    def next_goal(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        reached = goal - way <= NEAR * first
        return np.where(reached, goal + first, goal)

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations that stayed up and were fast enough."""
        seconds = outcome.path.shape[1] * outcome.trajectory.time_step
        return outcome.stayed_up & (outcome.path[:, -1] >= config.travel.speed * seconds)

    def second(self, whole: Recording, config: CertificateConfig) -> Criterion:
        """Fast enough, and not much slower in the second half."""
        wanted = config.travel
        way = whole.trunk_pos[:, 0]
        half, seconds = len(way) // 2, len(way) * whole.time_step
        first, second = way[half], way[-1] - way[half]
        return Criterion(
            2,
            "travels",
            (
                at_least("speed (m/s)", way[-1] / seconds, wanted.speed),
                steady("second half's speed / first", first, second, wanted.second_half),
            ),
        )

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Criteria of all tasks with a goal, and 7: no motion by vibration."""
        gait = Criterion(7, "gait", (vibration(whole, config.gait),))
        return (*super().undisturbed(whole, halved, config), gait)

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        """Distance travelled, and number of goals."""
        way, goal, goals = whole.trunk_pos[:, 0], np.array(whole.goal), 0
        for place in np.maximum.accumulate(way):
            ahead = self.next_goal(goal, np.array(whole.goal), place)
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
        """No early end, and fast enough."""
        fast: np.ndarray = outcome["way"] >= CertificateConfig().travel.speed * seconds
        return to_the_end(outcome, seconds, creature) & fast
