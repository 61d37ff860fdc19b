"""Who of a population walks: the best few before the examiner in C MuJoCo, at the end of a run and on the way there."""

import dataclasses
from collections.abc import Callable

import numpy as np

from mjxgait.certify import Certificate, CertificateConfig, Glance, certify, glance
from mjxgait.champion import Champion
from mjxgait.config import Config, ExaminationConfig
from mjxgait.evolution import EvolutionState
from mjxgait.experiment import Experiment
from mjxgait.fitness import TERMS

SPARE = 1.2
"""How much faster than the certificate's least speed a gait should be in evolution before it is worth an examination."""


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
    _margins: dict[str, float] = dataclasses.field(default_factory=dict)
    """Of the champions that did not do on the way, by fingerprint, at most: another look would say the same."""

    def early(self, state: EvolutionState) -> Examined | None:
        """The best individual with its certificate, if it is time to look and it passes with the margin that ends a run.

        Depends on nothing but the state and the settings, so that a resumed run ends where it would have ended. An examination takes as
        long as ten generations: first comes what evolution knows already, then the undisturbed walk alone.
        """
        config, generation = self.experiment.config, int(state.generation)
        if not due(config.examination, generation) or not _promising(state, config.rollout.seconds):
            return None
        wanted = enough(config, generation)
        champion = self.experiment.champion(state, self.versions)
        if self._margins.get(champion.fingerprint, np.inf) < wanted:
            return None
        seen = glance(self.experiment.creature, champion)
        margin = seen.margin
        if margin >= wanted:
            examined = self._examine(champion, seen, "the best")
            margin = examined.certificate.margin
            if examined.certificate.passed and margin >= wanted:
                return examined
        self._margins[champion.fingerprint] = margin
        return None

    def best(self, state: EvolutionState) -> Examined | None:
        """The first of the best few that passes; if none does, the one that comes nearest. None if nobody is to be examined.

        Who fails undisturbed is not examined further, but for the one that comes nearest when nobody passes.
        """
        examined: list[Examined] = []
        failed: list[tuple[Champion, Glance]] = []
        for rank in self.experiment.candidates(state):
            champion = self.experiment.champion(state, self.versions, rank)
            seen = glance(self.experiment.creature, champion)
            if seen.margin < 0:
                failed.append((champion, seen))
                continue
            examined.append(
                self._examine(champion, seen, "the next best" if examined or failed else "the best")
            )
            if examined[-1].certificate.passed:
                return examined[-1]
        nearest = max(failed, key=lambda pair: pair[1].margin, default=None)
        if nearest and all(e.certificate.margin < nearest[1].margin for e in examined):
            examined.append(self._examine(*nearest, "who comes nearest"))
        return max(examined, key=lambda e: e.certificate.margin, default=None)

    def _examine(self, champion: Champion, seen: Glance, who: str) -> Examined:
        self.tell(f"Generation {champion.origin['generation']}: examining {who} in C MuJoCo…")
        return Examined(certify(self.experiment.creature, champion, seen=seen), champion)


def enough(config: Config, generation: int) -> float:
    """The margin with which a run ends early: room to spare in the first half of its generations, any pass after that."""
    return config.examination.enough if 2 * generation <= config.evolution.generations else 0.0


def due(settings: ExaminationConfig, generation: int) -> bool:
    """Whether a run looks at its best after this generation, before its last."""
    return (
        bool(settings.every and settings.candidates)
        and generation > 0
        and generation % settings.every == 0
    )


def _promising(state: EvolutionState, seconds: float) -> bool:
    """Whether the best individual was up to the end on all its starts, and clearly faster than it must be."""
    wanted = SPARE * CertificateConfig().progress.speed * seconds
    terms = dict(zip(TERMS, np.asarray(state.terms[0]).T, strict=True))
    return bool((terms["alive"] >= 1).all() and (terms["distance"] >= wanted).all())
