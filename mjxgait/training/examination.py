"""Who of a population walks: looks at the best few in C MuJoCo and has one of them examined."""

import dataclasses
import threading
from collections.abc import Callable, Sequence

import numpy as np

from mjxgait.certification import (
    Certificate,
    Glance,
    certify,
    glance,
    rehearse,
)
from mjxgait.certification.stress import Stress, stress
from mjxgait.certification.tasks import demands_of, promising
from mjxgait.champion import Champion
from mjxgait.config.schema import Config, ExaminationConfig
from mjxgait.evolution.state import EvolutionState
from mjxgait.training.disk import disk_errors
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Experiment
from mjxgait.training.prescreen import Tryout


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


def passed_or_first(tried: Sequence[Examined]) -> Examined | None:
    """Of those that were examined, one that is certified, else the first."""
    certified = (one for one in tried if one.certificate.passed)
    return next(certified, tried[0] if tried else None)


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
      tryout: in the order of which its best are looked at; None looks at them in their own.
    """

    experiment: Experiment
    versions: dict[str, str]
    tell: Callable[[str], None]
    exams: Exams
    tryout: Tryout | None = None
    examines: threading.Event = dataclasses.field(default_factory=threading.Event)
    """Set once a look has become an examination, which takes all cores."""
    _margins: dict[str, float] = dataclasses.field(default_factory=dict)
    """Of the champions that did not do on the way, by fingerprint, at most: another look would say the same."""

    def early(self, state: EvolutionState) -> Examined | None:
        """One of the best with its certificate, if it is time to look and it passes.

        Depends on nothing but the state, the settings and the examinations that led here, so that a
        resumed run ends where it would have ended. Looking takes as long as five generations: first
        comes what evolution knows already, then the tryout if there is one, then the undisturbed
        walk, then the draw to choose on. The last examination that the settings allow is kept for
        the end.
        """
        config, generation = self.experiment.config, int(state.generation)
        if not due(config.examination, generation):
            return None
        ranks, most = self.experiment.candidates(state), config.examination.on_the_way
        if self.tryout is None:
            ranks = ranks[:most]
        likely = [rank for rank in ranks if _promising(self.experiment, state, rank)]
        wanted = enough(config, generation)
        able = [rank for rank, margin in self._in_order(state, likely) if margin >= wanted]
        for rank in able[:most]:
            champion = self.experiment.champion(state, self.versions, rank)
            if examined := self._on_the_way(champion, generation):
                return examined
        return None

    def _in_order(self, state: EvolutionState, ranks: list[int]) -> list[tuple[int, float]]:
        """These individuals, each with the margin that it has by the tryout, the best first; without
        a tryout in their own order, and nobody is doubted.
        """
        if self.tryout is None or not ranks:
            return [(rank, np.inf) for rank in ranks]
        shares = self.tryout.shares(state, ranks)
        order = np.argsort(-shares, kind="stable")
        return [(ranks[place], self.tryout.margin(shares[place])) for place in order]

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

        Whoever has room to spare is examined at once; when all have been looked at, those who have
        any, the best margin first. It ends with the first that passes, or when the run has no
        examination left. If nobody passes it is the first that was examined: the best margin of
        all if nobody had any. One that has failed on the way is chosen only if there is no other.
        Of those that have failed the tryout only the best is looked at, and only if all have.
        """
        generation, settings = int(state.generation), self.experiment.config.examination
        known: list[Champion] = []
        waiting: list[Seen] = []
        tried: list[Examined] = []
        order = self._in_order(state, self.experiment.candidates(state))
        for rank, _ in [one for one in order if one[1] >= 0] or order[:1]:
            champion = self.experiment.champion(state, self.versions, rank)
            if self.exams.failed(champion.fingerprint, generation - 1):
                known.append(champion)
                continue
            beaten = max((seen.margin for seen in waiting), default=-np.inf)
            seen = self._look(champion, 0.0, min(beaten, 0.0))
            if seen.margin < settings.enough:
                waiting.append(seen)
            elif self._examined(seen, tried) or self._spent(generation):
                return passed_or_first(tried)
        if not waiting and not tried:
            waiting = [self._look(champion, np.inf, np.inf) for champion in known[:1]]
        for seen in sorted(waiting, key=lambda seen: -seen.margin):
            if tried and (seen.margin < 0 or self._spent(generation)):
                break
            if self._examined(seen, tried):
                break
        return passed_or_first(tried)

    def _examined(self, seen: Seen, tried: list[Examined]) -> bool:
        """Whether it is certified; it is kept among those that were tried."""
        tried.append(self._examine(seen))
        return tried[-1].certificate.passed

    def _spent(self, generation: int) -> bool:
        """Whether the run has had all its examinations."""
        return self.exams.taken(generation) >= self.experiment.config.examination.attempts

    def _look(self, champion: Champion, wanted: float, beaten: float) -> Seen:
        """At the undisturbed walk, and if its margin is what is wanted, at the disturbed ones; at
        all of them only if they can still have a margin of `beaten`.
        """
        creature = champion.embodied(self.experiment.creature)
        seen = glance(creature, champion)
        margin = seen.margin
        if margin >= wanted:
            settings = self.experiment.config.examination
            draw, caution = settings.draws, settings.caution
            rehearsed = rehearse(creature, champion, draw, wanted=beaten, caution=caution)
            margin = min(margin, rehearsed)
        return Seen(champion, seen, margin)

    def _examine(self, seen: Seen, hasty: bool = False) -> Examined:
        name, generation = seen.champion.fingerprint, int(seen.champion.origin["generation"])
        attempt = self.exams.attempt(name, generation)
        self.tell(
            f"Generation {generation}: examining the champion in C MuJoCo, attempt {attempt}…"
        )
        body = seen.champion.embodied(self.experiment.creature)
        self.examines.set()
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
    return promising(demands, outcome, config.rollout.seconds, experiment.creature)
