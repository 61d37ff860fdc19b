"""Acceptance criteria for following: approach lights that evolution did not use."""

import dataclasses

import numpy as np
from typing_extensions import override

from mjxgait.certification.acceptance import Commands
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least
from mjxgait.champion import Champion
from mjxgait.controllers.sims_brain.reference_body import DRAG, LIGHT
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.modular.criteria import ModularCriteria, by_water, counted, in_trial, seen
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
        self.revision = 2 if drag else 3
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
        return in_trial(champion, "way") / (seconds - self.since(champion, config))

    @override
    def since(self, champion: Champion, config: CertificateConfig) -> float:
        return in_trial(champion, "since", config.warmup)

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """A light for each simulation without one, the nominal one ahead."""
        ahead = np.array([LIGHT, 0.0, 0.0])
        drawn = ahead if rng is None else self._directions(len(starts), rng)
        return dataclasses.replace(
            starts, light=np.where(starts.light.any(1, keepdims=True), starts.light, drawn)
        )

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations that approach as fast as criterion 2 requires, measured alike."""
        middle = counted(outcome.middle, outcome, config)
        apart = (middle - starts.light[:, None])[..., : self.axes]
        nearer = approach(apart, outcome.trajectory.time_step)
        return outcome.stayed_up & (nearer >= config.follow.speed)

    def commands(
        self, config: CertificateConfig, time_step: float, rng: np.random.Generator
    ) -> Commands:
        """Draw lights that move once, by a right angle or more as seen from the start."""
        count, moves = config.follow.moved, config.follow.moves
        light, other = self._directions(count, rng), self._directions(count, rng)
        other *= -np.copysign(1.0, (light * other).sum(1, keepdims=True))
        lights = {"light": light, "moved_light": other, "light_time": np.full(count, moves)}
        return Commands(moves + config.seconds, lights=lights)

    def obeyed(
        self, outcome: Outcome, commands: Commands, config: CertificateConfig
    ) -> tuple[Criterion, ...]:
        """Evaluate criterion 12: after the move the light is approached as fast."""
        time_step, light = outcome.trajectory.time_step, commands.lights["moved_light"]
        since = round((config.follow.moves + config.warmup) / time_step)
        apart = (outcome.middle[:, since:] - light[:, None])[..., : self.axes]
        well = outcome.stayed_up & (approach(apart, time_step) >= config.follow.speed)
        share = at_least("share that follows", float(well.mean()), config.follow.arrive, 1.0)
        return (Criterion(12, "a light that moves", (share,)),)

    def _directions(self, count: int, rng: np.random.Generator) -> np.ndarray:
        drawn = rng.normal(size=(count, 3))
        drawn[:, self.axes :] = 0.0
        lights: np.ndarray = LIGHT * drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
        return lights

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
