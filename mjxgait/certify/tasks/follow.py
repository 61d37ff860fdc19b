"""What is demanded of followers: to get nearer to lights that nobody has seen."""

import dataclasses

import numpy as np

from mjxgait.certify.config import CertificateConfig
from mjxgait.certify.criteria import Criterion, at_least
from mjxgait.certify.measure import Recording
from mjxgait.certify.outcome import Outcome
from mjxgait.certify.starts import Starts
from mjxgait.certify.tasks.blocks import BlocksDemands, seen
from mjxgait.certify.tasks.roam import balanced
from mjxgait.certify.tasks.swim import by_water
from mjxgait.certify.thresholds.blocks import FollowConfig
from mjxgait.champion import Champion
from mjxgait.champion.blocks.material import LIGHT


class FollowDemands(BlocksDemands):
    """See `Demands`. drag: 0 on land."""

    verdict = "it follows a light"
    verb = "follows"
    promised = "speed"

    def __init__(self, drag: float) -> None:
        self.drag = drag
        self.axes = 3 if drag else 2

    def wanted(self, config: CertificateConfig) -> FollowConfig:
        """See `BlocksDemands`."""
        return config.follow

    def second(self, window: Recording, config: CertificateConfig) -> Criterion:
        """See `BlocksDemands`."""
        nearer = at_least("speed towards it (m/s)", self.done(window), config.follow.speed)
        return Criterion(2, "follows", (nearer,))

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """See `BlocksDemands`: what is demanded of who swims or walks."""
        if self.drag:
            return (by_water(window, config.swim),)
        return (balanced(window, config.roam),)

    def done(self, window: Recording) -> float:
        """See `BlocksDemands`: m/s, by which the distance becomes less."""
        assert window.light is not None
        apart = (seen(window).middle - window.light)[:, : self.axes]
        before, after = np.linalg.norm(apart[[0, -1]], axis=1)
        return float((before - after) / ((len(apart) - 1) * window.time_step))

    def promise(self, champion: Champion, seconds: float, config: CertificateConfig) -> float:
        """See `BlocksDemands`: of the light that it is recorded with, not of all."""
        way = champion.origin.get("nominal", {}).get("way", np.nan)
        return float(way / (seconds - self.since(champion, config)))

    def since(self, champion: Champion, config: CertificateConfig) -> float:
        """See `BlocksDemands`."""
        return float(champion.origin.get("nominal", {}).get("since", config.warmup))

    def aimed(
        self, starts: Starts, config: CertificateConfig, rng: np.random.Generator | None = None
    ) -> Starts:
        """See `Demands`: a light for each that has none, the nominal one ahead."""
        ahead = np.tile([1.0, 0.0, 0.0], (len(starts), 1))
        drawn = ahead if rng is None else rng.normal(size=(len(starts), 3))
        drawn[:, self.axes :] = 0.0
        drawn *= LIGHT / np.linalg.norm(drawn, axis=1, keepdims=True)
        return dataclasses.replace(
            starts, light=np.where(starts.light.any(1, keepdims=True), starts.light, drawn)
        )

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """See `Demands`: those that got nearer fast enough, from the start to the end."""
        seconds = outcome.path.shape[1] * outcome.trajectory.time_step
        apart = (starts.light - outcome.travel)[:, : self.axes]
        nearer = np.linalg.norm(starts.light[:, : self.axes], axis=1) - np.linalg.norm(
            apart, axis=1
        )
        return outcome.stayed_up & (nearer >= config.follow.speed * seconds)

    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """See `BlocksDemands`: m in the seconds that count, as much nearer as it must get in all."""
        return config.follow.speed * seconds
