"""Acceptance criteria for competing: nearer to the cube than the opponent, from any start."""

import numpy as np
from typing_extensions import override

from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, at_least
from mjxgait.champion import Champion
from mjxgait.reference.measure import Recording
from mjxgait.reference.outcome import Outcome
from mjxgait.reference.starts import Starts
from mjxgait.tasks.modular.criteria import ModularCriteria, in_trial, seen, unshaken
from mjxgait.tasks.modular.thresholds import CompeteThresholds

DRAW = 0.5


class CompeteCriteria(ModularCriteria):
    """Implementation of `AcceptanceCriteria`. The opponent is that of the champion's last trial."""

    verdict = "it beats its opponent"
    verb = "wins"
    promised = evidence = "share"
    worth = 0.75
    repeats = False
    """A fight is chaotic: it must be won at half the time step too, not by the same share."""

    @override
    def wanted(self, config: CertificateConfig) -> CompeteThresholds:
        return config.compete

    @override
    def second(self, window: Recording, config: CertificateConfig) -> Criterion:
        share = at_least("share of the cube", self.done(window), config.compete.share, 1.0)
        return Criterion(2, "competes", (share,))

    def done(self, window: Recording) -> float:
        """Share of the cube: mean nearness over the frames."""
        return float(nearness(seen(window).gaps).mean())

    def promise(self, champion: Champion, seconds: float, config: CertificateConfig) -> float:
        """For the undisturbed trial, not for all."""
        return in_trial(champion, "share")

    @override
    def since(self, champion: Champion, config: CertificateConfig) -> float:
        return in_trial(champion, "since", config.warmup)

    def alone(self, window: Recording, config: CertificateConfig) -> tuple[Criterion, ...]:
        """Criterion 7, no motion by vibration."""
        return (unshaken(window, config),)

    def succeeded(self, outcome: Outcome, starts: Starts, config: CertificateConfig) -> np.ndarray:
        """Simulations that the body wins: nearer to the cube, over the second half of the time."""
        half = outcome.gaps.shape[1] // 2
        won: np.ndarray = nearness(outcome.gaps[:, half:]).mean(1) > DRAW
        return outcome.stayed_up & won

    def enough(self, seconds: float, config: CertificateConfig) -> float:
        """A share clearly above a draw."""
        return config.compete.share

    def report(self, whole: Recording, config: CertificateConfig) -> dict[str, object]:
        """The share, and the body."""
        known = super().report(whole, config)
        done = self.done(whole.window(config.warmup))
        return {**known, "summary": f"{known['parts']} blocks, {done:.0%} of the cube"}


def nearness(gaps: np.ndarray) -> np.ndarray:
    """Return the opponent's distance from the cube over the sum of both; gaps: [..., 2] m."""
    found: np.ndarray = gaps[..., 1] / np.maximum(gaps.sum(-1), 1e-6)
    return found
