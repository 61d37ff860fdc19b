"""Who of a population walks: looks at the best few in C MuJoCo and has one of them examined."""

import dataclasses
from collections.abc import Callable

import numpy as np

from mjxgait.certify import Certificate, Glance, certify, glance, rehearse
from mjxgait.certify.stress import Stress, stress
from mjxgait.certify.tasks import demands_of
from mjxgait.champion import Champion
from mjxgait.runs.disk import disk_errors
from mjxgait.runs.exams import Exams
from mjxgait.runs.experiment import Experiment
from mjxgait.search.state import EvolutionState
from mjxgait.settings.config import Config, ExaminationConfig


@dataclasses.dataclass(frozen=True, eq=False)
class Examined:
    """A champion and what the examiner says of it; beyond: of the second level, where that is asked
    for and it has the first.
    """

    certificate: Certificate
    champion: Champion
    beyond: Stress | None = None

    @property
    def passed(self) -> bool:
        """Whether it has what was asked for."""
        return self.certificate.passed and (self.beyond is None or self.beyond.passed)


def why_ended(generation: int, margin: float) -> str:
    """Why a run is over that an early examination ended."""
    return f"certified with a margin of {margin:.2f} in generation {generation}"


@dataclasses.dataclass(frozen=True, eq=False)
class Seen:
    """A champion that is looked at before it is examined; margin: by which it is chosen."""

    champion: Champion
    glance: Glance
    margin: float


@dataclasses.dataclass(frozen=True, eq=False)
class Examiner:
    """Chooses individuals of a run on one draw of starts and pushes, and examines them on another.

    Attributes:
      versions: of the packages, for the champions. tell: called with what is about to be done.
      exams: the run's examinations so far. Each is one more try, and the certificate says which.
    """

    experiment: Experiment
    versions: dict[str, str]
    tell: Callable[[str], None]
    exams: Exams
    _margins: dict[str, float] = dataclasses.field(default_factory=dict)
    """Of the champions that did not do on the way, by fingerprint, at most: another look would say the same."""

    def early(self, state: EvolutionState) -> Examined | None:
        """One of the best with its certificate, if it is time to look and it passes.

        Depends on nothing but the state, the settings and the examinations that led here, so that a
        resumed run ends where it would have ended. Looking takes as long as five generations: first
        comes what evolution knows already, then the undisturbed walk, then the draw to choose on.
        The last examination that the settings allow is kept for the end.
        """
        settings, generation = self.experiment.config.examination, int(state.generation)
        if not due(settings, generation):
            return None
        for rank in self.experiment.candidates(state)[: settings.on_the_way]:
            if not _promising(self.experiment, state, rank):
                continue
            champion = self.experiment.champion(state, self.versions, rank)
            if examined := self._on_the_way(champion, generation):
                return examined
        return None

    def _on_the_way(self, champion: Champion, generation: int) -> Examined | None:
        """With its certificate, if it passes; nobody is looked at twice."""
        config, name = self.experiment.config, champion.fingerprint
        wanted = enough(config, generation)
        if self._margins.get(name, np.inf) < wanted or self.exams.failed(name, generation):
            return None
        if self.exams.attempt(name, generation) >= config.examination.attempts:
            return None
        seen = self._look(champion, wanted, beaten=wanted)
        if seen.margin >= wanted and (examined := self._examine(seen, hasty=True)).passed:
            return examined
        self._margins[name] = seen.margin
        return None

    def best(self, state: EvolutionState) -> Examined | None:
        """One of the best few with its certificate, passed or not; None if there are none.

        Chosen is the first that has room to spare, else the one with the best margin. Only that one
        is examined; one that has failed on the way only if there is no other.
        """
        known: list[Champion] = []
        chosen: list[Seen] = []
        for rank in self.experiment.candidates(state):
            champion = self.experiment.champion(state, self.versions, rank)
            if self.exams.failed(champion.fingerprint, int(state.generation) - 1):
                known.append(champion)
                continue
            beaten = max((seen.margin for seen in chosen), default=-np.inf)
            chosen.append(self._look(champion, 0.0, beaten))
            if chosen[-1].margin >= self.experiment.config.examination.enough:
                break
        chosen = chosen or [self._look(champion, np.inf, np.inf) for champion in known[:1]]
        return self._examine(max(chosen, key=lambda seen: seen.margin)) if chosen else None

    def _look(self, champion: Champion, wanted: float, beaten: float) -> Seen:
        """At the undisturbed walk, and if its margin is what is wanted, at the disturbed ones; at
        all of them only if they can still have a margin of `beaten`.
        """
        creature = champion.embodied(self.experiment.creature)
        seen = glance(creature, champion)
        margin = seen.margin
        if margin >= wanted:
            count = self.experiment.config.examination.draws
            margin = min(margin, rehearse(creature, champion, count, wanted=beaten))
        return Seen(champion, seen, margin)

    def _examine(self, seen: Seen, hasty: bool = False) -> Examined:
        name, generation = seen.champion.fingerprint, int(seen.champion.origin["generation"])
        attempt = self.exams.attempt(name, generation)
        self.tell(
            f"Generation {generation}: examining the champion in C MuJoCo, attempt {attempt}…"
        )
        body = seen.champion.embodied(self.experiment.creature)
        certificate = certify(body, seen.champion, seen=seen.glance, attempts=attempt)
        beyond = None
        if certificate.passed and self.experiment.config.examination.level == "anywhere":
            self.tell("It walks; does it walk anywhere?")
            beyond = stress(body, seen.champion, hasty=hasty)
            self.tell("\n".join(beyond.rows()))
        examined = Examined(certificate, seen.champion, beyond)
        with disk_errors(self.exams.path.parent):
            self.exams.add(name, generation, examined.passed)
        return examined


def enough(config: Config, generation: int) -> float:
    """The margin that is worth an examination on the way.

    Room to spare in the first half of a run's generations, any in the second.
    """
    return config.examination.enough if 2 * generation <= config.evolution.generations else 0.0


def due(settings: ExaminationConfig, generation: int) -> bool:
    """Whether a run looks at its best after this generation, before its last."""
    return (
        bool(settings.every and settings.candidates)
        and generation > 0
        and generation % settings.every == 0
    )


def _promising(experiment: Experiment, state: EvolutionState, rank: int) -> bool:
    """Whether an individual is worth an examination."""
    config, names = experiment.config, experiment.simulator.task.outcomes
    outcome = dict(zip(names, np.asarray(state.outcome[rank]).T, strict=True))
    demands = demands_of(config.use.task, config.wish)
    return demands.promising(outcome, config.rollout.seconds, experiment.creature)
