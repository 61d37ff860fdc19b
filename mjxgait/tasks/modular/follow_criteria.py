"""Acceptance criteria for following: approach lights that evolution did not use."""

import dataclasses

import numpy as np
from typing_extensions import override

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least
from mjxgait.champion import Champion
from mjxgait.controllers.sims_brain.reference_body import DRAG, LIGHT
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.modular.criteria import ModularCriteria, by_water, counted, seen
from mjxgait.tasks.modular.criteria import on_land as walks
from mjxgait.tasks.modular.thresholds import FollowThresholds


class FollowCriteria(ModularCriteria):
    """Implementation of `AcceptanceCriteria`. drag: 0 on land."""

    verdict = "it follows a light"
    verb = "follows"
    promised = "speed"
    worth = 0.75
    """As many of the lights as criterion 4 requires."""

    def __init__(self, drag: float) -> None:
        self.drag = drag
        self.revision = 1 if drag else 2
        self.axes = 3 if drag else 2

    @override
    def wanted(self, config: CertificateConfig) -> FollowThresholds:
        return config.follow

    @override
    def second(self, window: Recording, config: CertificateConfig) -> Criterion:
        nearer = at_least("speed towards it (m/s)", self.done(window), config.follow.speed)
        return Criterion(2, "follows", (nearer,))

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """The criterion of swimming or of walking."""
        if self.drag:
            return (by_water(window, config.swim),)
        return walks(window, config)

    def done(self, window: Recording) -> float:
        """Speed of the approach in m/s."""
        assert window.light is not None
        apart = (seen(window).middle - window.light)[:, : self.axes]
        return float(approach(apart, window.time_step))

    def promise(self, champion: Champion, seconds: float, config: CertificateConfig) -> float:
        """For the light of the recording, not for all."""
        way = champion.origin.get("nominal", {}).get("way", np.nan)
        return float(way / (seconds - self.since(champion, config)))

    @override
    def since(self, champion: Champion, config: CertificateConfig) -> float:
        return float(champion.origin.get("nominal", {}).get("since", config.warmup))

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """A light for each simulation without one, the nominal one ahead."""
        ahead = np.tile([1.0, 0.0, 0.0], (len(starts), 1))
        drawn = ahead if rng is None else rng.normal(size=(len(starts), 3))
        drawn[:, self.axes :] = 0.0
        drawn *= LIGHT / np.linalg.norm(drawn, axis=1, keepdims=True)
        return dataclasses.replace(
            starts, light=np.where(starts.light.any(1, keepdims=True), starts.light, drawn)
        )

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations that approach as fast as criterion 2 requires, measured alike."""
        middle = counted(outcome.middle, outcome, config)
        apart = (middle - starts.light[:, None])[..., : self.axes]
        nearer = approach(apart, outcome.trajectory.time_step)
        return outcome.stayed_up & (nearer >= config.follow.speed)

    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """The approach in m due in all seconds, made in those that count."""
        return config.follow.speed * seconds


def approach(apart: np.ndarray, time_step: float) -> np.ndarray:
    """Speed of approach [...] in m/s; apart: [..., T, 2 or 3] m from the light."""
    first, last = (np.linalg.norm(apart[..., k, :], axis=-1) for k in (0, -1))
    speed: np.ndarray = (first - last) / ((apart.shape[-2] - 1) * time_step)
    return speed


def in_water() -> FollowCriteria:
    """Return the criteria of a swimmer that follows a light."""
    return FollowCriteria(DRAG)


def on_land() -> FollowCriteria:
    """Return the criteria of a walker that follows a light."""
    return FollowCriteria(0.0)
