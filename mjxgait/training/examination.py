"""Validation of the best few of a population in C MuJoCo, and the examination of one of them."""

import dataclasses
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future

import numpy as np

from mjxgait.certification import (
    Certificate,
    CertificateConfig,
    NominalCheck,
    certify,
    nominal_check,
    trial_run,
)
from mjxgait.certification.acceptance import acceptance_of, promising
from mjxgait.certification.stress import Stress, StressConfig, stress
from mjxgait.certification.trials import own_draw
from mjxgait.champion import Champion
from mjxgait.config.schema import ExaminationConfig
from mjxgait.errors import listed
from mjxgait.evolution.state import EvolutionState
from mjxgait.training.disk import disk_errors
from mjxgait.training.exams import Exams
from mjxgait.training.experiment import Experiment
from mjxgait.training.prescreen import Prescreen

SURER = 4
"""Factor on the starts of a validation after an examination that failed."""
REHEARSAL = StressConfig(starts=16, long=StressConfig.seconds)
"""Stress tests of a validation: fewer starts, and no ten minutes."""


@dataclasses.dataclass(frozen=True, eq=False)
class Examined:
    """A champion and its certificate.

    beyond: stress test result, if the settings ask for that level and the certificate passed.
    """

    certificate: Certificate
    champion: Champion
    beyond: Stress | None = None

    @property
    def passed(self) -> bool:
        """Whether it passed all that the settings ask for."""
        return self.certificate.passed and (self.beyond is None or self.beyond.passed)


def passed_or_first(tried: Sequence[Examined]) -> Examined | None:
    """Return the first certified individual of those examined, else the first of all."""
    certified = (one for one in tried if one.certificate.passed)
    return next(certified, tried[0] if tried else None)


def why_ended(generation: int, margin: float) -> str:
    """Return why a run is over that ended with an early examination."""
    return f"certified with a margin of {margin:.2f} in generation {generation}"


@dataclasses.dataclass(frozen=True, eq=False)
class Validated:
    """A validated champion, before its examination. margin: used to choose."""

    champion: Champion
    nominal_check: NominalCheck
    margin: float


@dataclasses.dataclass(frozen=True, eq=False)
class Examiner:
    """Chooses individuals of a run on one draw of starts and pushes, and examines them on another.

    Attributes:
      versions: package versions, for the champions. tell: called with a message before each step.
      exams: the run's examinations so far. Each is an attempt; the certificate states its number.
      prescreen: ranks the candidates before validation; None keeps the order by fitness.
    """

    experiment: Experiment
    versions: dict[str, str]
    tell: Callable[[str], None]
    exams: Exams
    prescreen: Prescreen | None = None
    examines: threading.Event = dataclasses.field(default_factory=threading.Event)
    """Set once the undisturbed walk of a validation is good enough. The rest uses all cores, and
    often ends the run, which discards what evolves meanwhile."""
    _margins: dict[tuple[str, int], float] = dataclasses.field(default_factory=dict)
    """Upper bound of the margin by fingerprint and number of starts, of champions that missed it
    during the run. Validating them again would give the same."""

    def early(self, state: EvolutionState) -> Examined | None:
        """Return one of the best with its certificate, if validation is due and it passes.

        Depends only on the state, the settings and the earlier examinations, so that a resumed run
        ends in the same generation. Validation takes as long as five generations, so cheap checks
        come first: evolution's own metrics, pre-screening if enabled, the undisturbed walk, the
        draw to choose on. The last examination that the settings allow is kept for the end.
        """
        config, generation = self.experiment.config, int(state.generation)
        if not due(config.examination, generation):
            return None
        ranks, most = self.experiment.candidates(state), config.examination.on_the_way
        if self.prescreen is None:
            ranks = ranks[:most]
        likely = [rank for rank in ranks if _promising(self.experiment, state, rank)]
        wanted = self._wanted(generation)
        able = [rank for rank, margin in self._in_order(state, likely) if margin >= wanted]
        for rank in able[:most]:
            champion = self.experiment.champion(state, self.versions, rank)
            if examined := self._on_the_way(champion, generation):
                return examined
        return None

    def _wanted(self, generation: int) -> float:
        """Return the margin required for an examination during the run.

        It is `examination.enough` in the first half of the generations and 0 in the second.
        """
        config = self.experiment.config
        return config.examination.enough if 2 * generation <= config.evolution.generations else 0.0

    def _starts(self, generation: int) -> int:
        """Return the number of starts to choose on: more once a certificate has failed.

        The champion that failed was lucky on the smaller draw, and few attempts are left.
        """
        starts = self.experiment.config.examination.draws
        return starts * SURER if self.exams.any_failed(generation) else starts

    def _in_order(self, state: EvolutionState, ranks: list[int]) -> list[tuple[int, float]]:
        """Return the individuals, each with its margin by pre-screening, best first.

        Without pre-screening their order stays, and every margin is infinite.
        """
        if self.prescreen is None or not ranks:
            return [(rank, np.inf) for rank in ranks]
        shares = self.prescreen.shares(state, ranks)
        order = np.argsort(-shares, kind="stable")
        return [(ranks[place], self.prescreen.margin(shares[place])) for place in order]

    def _on_the_way(self, champion: Champion, generation: int) -> Examined | None:
        """Return a champion with its certificate, if it passes; never validate it twice."""
        config, name = self.experiment.config, champion.fingerprint
        wanted = self._wanted(generation)
        known = name, self._starts(generation)
        if self._margins.get(known, np.inf) < wanted or self.exams.failed(name, generation):
            return None
        if self.exams.attempt(name, generation) >= config.examination.attempts:
            return None
        seen = self._validated(champion, wanted, beaten=wanted)
        self._margins[known] = seen.margin
        if seen.margin < wanted:
            return None
        if not self._rehearsed(champion):
            self._margins[known] = -np.inf
            return None
        examined = self._examine(seen, hasty=True)
        return examined if examined.passed else None

    def _rehearsed(self, champion: Champion) -> bool:
        """Return whether a champion passes the stress tests on a draw of its own, if they decide.

        An attempt costs a certificate and is one of few; a walk that falls on slopes wastes it.
        """
        if not self._goes_anywhere:
            return True
        body, draw = (
            champion.embodied(self.experiment.creature),
            own_draw(champion, CertificateConfig()),
        )
        return stress(body, champion, REHEARSAL, hasty=True, draw=draw).passed

    @property
    def _goes_anywhere(self) -> bool:
        return self.experiment.config.examination.level == "anywhere"

    def best(self, state: EvolutionState) -> Examined | None:
        """Return one of the best few with its certificate, passed or not; None if there are none.

        A candidate whose margin is at least `enough` is examined at once. When all are validated,
        the others with a margin of at least 0 are examined, the best margin first. The first that
        passes ends the search, as does the last attempt of the run. If none passes, return the
        first that was examined: the best margin of all if all are negative. A candidate that failed
        earlier in the run is chosen only if there is no other. Candidates that fail pre-screening
        are skipped; if all fail, only the best is validated.
        """
        generation, settings = int(state.generation), self.experiment.config.examination
        known: list[Champion] = []
        waiting: list[Validated] = []
        tried: list[Examined] = []
        order = self._in_order(state, self.experiment.candidates(state))
        for rank, _ in [one for one in order if one[1] >= 0] or order[:1]:
            champion = self.experiment.champion(state, self.versions, rank)
            if self.exams.failed(champion.fingerprint, generation - 1):
                known.append(champion)
                continue
            beaten = max((seen.margin for seen in waiting), default=-np.inf)
            seen = self._validated(champion, 0.0, min(beaten, 0.0))
            if seen.margin < settings.enough:
                waiting.append(seen)
            elif self._examined(seen, tried) or self._spent(generation):
                return passed_or_first(tried)
        if not waiting and not tried:
            waiting = [self._validated(champion, np.inf, np.inf) for champion in known[:1]]
        for seen in sorted(waiting, key=lambda seen: -seen.margin):
            if tried and (seen.margin < 0 or self._spent(generation)):
                break
            if self._examined(seen, tried):
                break
        return passed_or_first(tried)

    def _examined(self, seen: Validated, tried: list[Examined]) -> bool:
        """Examine a champion, append it to `tried`, and return whether it is certified."""
        tried.append(self._examine(seen))
        return tried[-1].certificate.passed

    def _spent(self, generation: int) -> bool:
        """Return whether the run has no attempt left."""
        return self.exams.taken(generation) >= self.experiment.config.examination.attempts

    def _validated(self, champion: Champion, wanted: float, beaten: float) -> Validated:
        """Validate the undisturbed walk; if its margin reaches `wanted`, also the disturbed ones.

        The disturbed walks stop once a margin of `beaten` is out of reach.
        """
        creature = champion.embodied(self.experiment.creature)
        seen = nominal_check(creature, champion)
        margin = seen.margin
        if margin >= wanted:
            self.examines.set()
            draw = self._starts(int(champion.origin["generation"]))
            caution = self.experiment.config.examination.caution
            by_trial_run = trial_run(creature, champion, draw, wanted=beaten, caution=caution)
            margin = min(margin, by_trial_run)
        return Validated(champion, seen, margin)

    def _examine(self, seen: Validated, hasty: bool = False) -> Examined:
        name, generation = seen.champion.fingerprint, int(seen.champion.origin["generation"])
        attempt = self.exams.attempt(name, generation)
        self.tell(
            f"Generation {generation}: examining the champion in C MuJoCo, attempt {attempt}…"
        )
        body = seen.champion.embodied(self.experiment.creature)
        certificate = certify(body, seen.champion, seen=seen.nominal_check, attempts=attempt)
        beyond = None
        if certificate.passed and self._goes_anywhere:
            self.tell("It walks; does it walk anywhere?")
            beyond = stress(body, seen.champion, hasty=hasty)
            self.tell("\n".join(beyond.rows()))
        examined = Examined(certificate, seen.champion, beyond)
        if hasty and not certificate.passed:
            self.tell(f"Not certified: {_missed(certificate)}.")
        with disk_errors(self.exams.path.parent):
            self.exams.add(name, generation, examined.passed)
        return examined


def _missed(certificate: Certificate) -> str:
    """Return the measures that fail, with their thresholds."""
    missed = [
        f"{criterion.skill}{m.name} {m.value:.3g} ({m.sense} {m.threshold:g} required)"
        for criterion in certificate.criteria
        for m in criterion.measures
        if not m.passed
    ]
    return listed(missed, 3)


def due(settings: ExaminationConfig, generation: int) -> bool:
    """Return whether a run validates its best after this generation, before its last."""
    return (
        bool(settings.every and settings.candidates)
        and generation > 0
        and generation % settings.every == 0
    )


def _promising(experiment: Experiment, state: EvolutionState, rank: int) -> bool:
    """Return whether an individual's metrics justify an examination."""
    config, names = experiment.config, experiment.simulator.task.outcomes
    outcome = dict(zip(names, np.asarray(state.outcome[rank]).T, strict=True))
    acceptance = acceptance_of(config.use.task, config.wish)
    return promising(acceptance, outcome, config.rollout.seconds, experiment.creature)


class Validation:
    """Asynchronous validations of one run, one at a time.

    The result is the same as if evolution had waited: a certified individual ends the run in the
    validated generation, and later generations are discarded.
    """

    def __init__(self, examiner: Examiner) -> None:
        self._examiner = examiner
        self._result: Future[Examined | None] | None = None
        self._state: EvolutionState | None = None

    def due(self, state: EvolutionState) -> bool:
        """Return whether validation of this generation is due and has not begun."""
        settings = self._examiner.experiment.config.examination
        return state is not self._state and due(settings, int(state.generation))

    def begin(self, state: EvolutionState) -> None:
        """Start a validation if it is due; all earlier results must have been `found`."""
        if not self.due(state):
            return
        self._state, self._result = state, Future()
        self._examiner.examines.clear()
        # Two programs that use all devices would block each other, so pre-screening waits here.
        if self._examiner.prescreen is not None:
            self._validate(self._result, state)
            return
        # A daemon thread: a second Ctrl-C does not wait for it.
        threading.Thread(target=self._validate, args=(self._result, state), daemon=True).start()

    def found(self, wait: bool) -> tuple[Examined, EvolutionState] | None:
        """Return the certified individual and the state of its generation, once known; else None.

        Args:
          wait: wait for the result. Once the disturbed walks have begun it waits anyway: evolution
            would compete for their cores, and its generations would be discarded if they pass.
        """
        if self._result is None or self._state is None:
            return None
        if not (wait or self._result.done() or self._examiner.examines.is_set()):
            return None
        examined, self._result = self._result.result(), None
        return None if examined is None else (examined, self._state)

    def _validate(self, result: Future[Examined | None], state: EvolutionState) -> None:
        try:
            result.set_result(self._examiner.early(state))
        except BaseException as error:
            result.set_exception(error)
