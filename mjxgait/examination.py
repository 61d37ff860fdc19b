"""Who of a population walks: the best few before the examiner in C MuJoCo, at the end of a run and on the way there."""

import dataclasses
from collections.abc import Callable

import numpy as np

from mjxgait.certify import Certificate, CertificateConfig, certify, glance
from mjxgait.champion import Champion
from mjxgait.config import ExaminationConfig
from mjxgait.evolution import EvolutionState
from mjxgait.experiment import Experiment
from mjxgait.fitness import TERMS

SPARE = 1.2
"""How much faster than the certificate's least speed a gait should be in evolution before it is worth an examination."""
MOST = 4
"""Whole examinations at the end of a run, at most; who fails undisturbed is not examined further."""


@dataclasses.dataclass(frozen=True, eq=False)
class Examined:
    """A champion and what the examiner says of it."""

    certificate: Certificate
    champion: Champion


def why_ended(generation: int, margin: float) -> str:
    """Why a run is over that an early examination ended."""
    return f"certified with a margin of {margin:.2f} in generation {generation}"


@dataclasses.dataclass(frozen=True, eq=False)
class Examiner:
    """Examines individuals of a run. versions: of the packages, for the champions. tell: called with what is about to be done."""

    experiment: Experiment
    versions: dict[str, str]
    tell: Callable[[str], None]
    _refused: set[str] = dataclasses.field(default_factory=set)
    """Fingerprints of the champions that did not do on the way: to look at them again would say the same."""

    def early(self, state: EvolutionState) -> Examined | None:
        """The best individual with its certificate, if it is time to look and it passes with the margin that ends a run.

        Depends on nothing but the state, so that a resumed run ends where it would have ended. An examination takes as long as ten
        generations: first comes what evolution knows already, then the undisturbed walk alone.
        """
        settings = self.experiment.config.examination
        if not due(settings, int(state.generation)) or not _promising(state, self.experiment.config.rollout.seconds):
            return None
        champion = self.experiment.champion(state, self.versions)
        if champion.fingerprint in self._refused:
            return None
        if glance(self.experiment.creature, champion) >= settings.enough:
            examined = self._examine(champion, "the best")
            if examined.certificate.passed and examined.certificate.margin >= settings.enough:
                return examined
        self._refused.add(champion.fingerprint)
        return None

    def best(self, state: EvolutionState) -> Examined | None:
        """The first of the best few that passes; if none does, the one that comes nearest. None if nobody is to be examined."""
        examined: list[Examined] = []
        failed: list[tuple[float, Champion]] = []
        for rank in self.experiment.candidates(state):
            champion = self.experiment.champion(state, self.versions, rank)
            margin = glance(self.experiment.creature, champion)
            if margin < 0:
                failed.append((margin, champion))
                continue
            examined.append(self._examine(champion, "the next best" if examined or failed else "the best"))
            if examined[-1].certificate.passed or len(examined) == MOST:
                break
        if failed and not examined:
            examined.append(self._examine(max(failed, key=lambda pair: pair[0])[1], "who comes nearest"))
        return max(examined, key=lambda e: (e.certificate.passed, e.certificate.margin), default=None)

    def _examine(self, champion: Champion, who: str) -> Examined:
        self.tell(f"Generation {champion.origin['generation']}: examining {who} in C MuJoCo…")
        return Examined(certify(self.experiment.creature, champion), champion)


def due(settings: ExaminationConfig, generation: int) -> bool:
    """Whether a run looks at its best after this generation, before its last."""
    return bool(settings.every and settings.candidates) and generation > 0 and generation % settings.every == 0


def _promising(state: EvolutionState, seconds: float) -> bool:
    """Whether the best individual was up to the end on all its starts, and clearly faster than it must be."""
    wanted = SPARE * CertificateConfig().progress.speed * seconds
    terms = dict(zip(TERMS, np.asarray(state.terms[0]).T, strict=True))
    return bool((terms["alive"] >= 1).all() and (terms["distance"] >= wanted).all())
