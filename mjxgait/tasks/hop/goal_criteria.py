"""Acceptance criteria common to the tasks with a goal."""

import abc
import dataclasses

import numpy as np

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import (
    Criterion,
    at_least,
    at_most,
    parts,
    physics,
)
from mjxgait.certification.tasks.staying import Unasked
from mjxgait.champion import Champion
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Fall
from mjxgait.reference.starts import Starts
from mjxgait.tasks.hop.thresholds import GoalConfig

HIGHEST = 1e3
"""Height limit in standing heights: a hopping trunk may be anywhere, but no part may lie."""


class GoalDemands(Unasked, abc.ABC):
    """See `Demands`. Pushes decide nothing: in half of a hop the body cannot react."""

    drag: float = 0.0
    pushed: bool = True
    by_pushes: bool = False
    grown: bool = False
    leaps: bool = False
    worth: float = 1.0
    share: str
    """Name of the share in criterion 4."""

    @abc.abstractmethod
    def wanted(self, config: CertificateConfig) -> GoalConfig:
        """Thresholds of this task."""

    @abc.abstractmethod
    def second(self, whole: Recording, config: CertificateConfig) -> Criterion:
        """Criterion 2: progress on the way."""

    def fall(self, config: CertificateConfig) -> Fall:
        """See `Demands`: a head or an elbow on the floor, or a base on its edge."""
        return Fall(min_up=self.wanted(config).min_up, height=(0.0, HIGHEST), touch=True)

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """See `Demands`: a goal for each simulation without one."""
        wanted = self.wanted(config)
        drawn = wanted.nominal if rng is None else rng.uniform(*wanted.goals, len(starts))
        return dataclasses.replace(starts, goal=np.where(starts.goal > 0, starts.goal, drawn))

    def undisturbed(
        self, whole: Recording, halved: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 1 and 2, both at half the time step too, 8, 9; without a warm-up."""
        basic, repeated = (self.basic(each, config) for each in (whole, halved))
        failed = sum(not m.passed for c in repeated for m in c.measures)
        of = " and ".join(str(c.number) for c in basic)
        return (
            *basic,
            Criterion(6, "half the time step", (at_most(f"failures in {of}", failed, 0.0),)),
            physics(whole, config.physics),
            parts(whole, config.parts),
        )

    def kept(
        self, champion: Champion, whole: Recording, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: evolution has promised nothing."""
        return ()

    def onward(self, goal: np.ndarray, first: np.ndarray, way: np.ndarray) -> np.ndarray:
        """See `Demands`: the same."""
        return goal

    def disturbed(
        self, started: float, pushed: float, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """See `Demands`: 4. The effect of pushes is only reported."""
        share = at_least(self.share, started, self.wanted(config).arrive, 1.0)
        return (Criterion(4, "perturbed starts and other goals", (share,)),)

    def basic(self, whole: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """Criteria of one recording, at any time step: 1 and 2."""
        up = at_least("least upright", whole.trunk_up.min(), self.wanted(config).min_up, 1.0)
        lies = at_most("time on wrong parts", whole.touch.mean(), 0.0)
        return (Criterion(1, "stays up", (up, lies)), self.second(whole, config))
